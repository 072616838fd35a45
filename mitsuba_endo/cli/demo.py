"""``mitsuba-endo demo``: the whole way from a scene to a judged calibration."""

import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .calibrate import exit_code, load_input, solve_and_write
from .console import Debug, Json, Quiet, Session, session
from .decode import decode_images
from .render import capture_scene
from .report import write_report

if TYPE_CHECKING:
    from ..evaluate.metrics_file import Metrics
    from ..records.solution import Solution

Out = Annotated[Path, typer.Option("--out", help="Folder to write.")]
Seed = Annotated[int, typer.Option(min=0, help="Seed of all random numbers.")]

SCENE = "stomach"
SETTINGS = {
    "width": "320", "height": "240", "fx": "226.7", "cx": "160.6", "cy": "118.1",
}  # fmt: skip
"""The scene's camera at two thirds of its resolution."""
SPP = 32
"""Samples per pixel. Chosen: half of the `render` command's default, to save time."""
IMAGE = "image.png"


def demo(
    out: Out = Path("demo-output"),
    seed: Seed = 0,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Render an endoscope in a stomach, calibrate it from its image, compare with the truth."""
    with session(quiet, as_json, debug) as output:
        from ..evaluate.kinds.calibration import evaluate_calibration
        from ..files import atomic_folder
        from ..folder_mark import Kind
        from ..outputs import prepare_folder
        from ..records.solution import load_solution
        from ..solve.options import Options

        started = time.perf_counter()
        prepare_folder(out, Kind.DEMO)
        with atomic_folder(out, Kind.DEMO) as folder:
            _make_input(folder, seed, output)
            rig_file, decoded = folder / "input" / "rig.yaml", folder / "decoded"
            decoded.mkdir()
            paths = decode_images([folder / "input" / IMAGE], rig_file, None, True, decoded, output)
            maps, rig = load_input(paths, rig_file)
            solution = solve_and_write(
                maps, rig, Options(seed=seed), folder / "solution", output, decoded=decoded
            )
            # Only now, after the solve, is the truth looked at.
            true = folder / "capture" / "truth.json"
            metrics = evaluate_calibration(folder / "solution", [true])
            metrics.save(folder / "metrics.json")
            write_report([folder / "solution"], folder / "solution" / "report.html", true)
            truth = load_solution(true)
        _report(solution, truth, metrics, out, time.perf_counter() - started, output)
        raise typer.Exit(exit_code(solution))


def _make_input(folder: Path, seed: int, output: Session) -> None:
    """Write the capture with its truth, and apart from it what a user would have of it."""
    from ..show.capture_folder import RIG, write_capture_folder

    capture, loaded = capture_scene(SCENE, SETTINGS, SPP, seed, output)
    write_capture_folder(folder / "capture", capture, loaded)
    (folder / "input").mkdir()
    for name in (IMAGE, RIG):
        shutil.copyfile(folder / "capture" / name, folder / "input" / name)


def _report(
    solution: "Solution",
    truth: "Solution",
    metrics: "Metrics",
    out: Path,
    seconds: float,
    output: Session,
) -> None:
    from .summary import comparison_table, error_table

    program = "mitsuba-endo" if shutil.which("mitsuba-endo") else sys.argv[0]
    output.print(
        f"An endoscope before a stomach wall, {SETTINGS['width']} x {SETTINGS['height']} pixels. "
        "One image of the coded grid; focal length, pose and surface unknown, the length of the "
        "baseline given.",
        comparison_table(solution, truth),
        error_table(metrics.tables()[0]),
        *solution.verdict,
        f"Outcome: {solution.outcome}, {seconds:.1f} s in all. Look at:",
        f"  {out}/capture/image.png        what the endoscope sees",
        f"  {out}/decoded/image_graph.png  the grid found in it",
        f"  {out}/solution/report.html     verdict, maps, surface, its error",
        f"  {out}/solution/solution.json   the result",
        f"  {out}/metrics.json             its errors",
        "Again by hand:",
        f"  {program} calibrate {out}/input/{IMAGE} \\",
        f"    --rig {out}/input/rig.yaml --out result",
    )
    output.summary(
        {
            "folder": str(out),
            "outcome": solution.outcome,
            "seconds": seconds,
            "metrics": metrics.model_dump(mode="json"),
        }
    )
