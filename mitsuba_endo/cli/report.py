"""``mitsuba-endo report``: the report of a result, or of several side by side."""

from pathlib import Path
from typing import Annotated

import typer

from .console import Debug, Json, Quiet, session
from .evaluate import result_files
from .options import MaybeTruth

Results = Annotated[
    list[Path], typer.Argument(metavar="RESULT...", help="Solution folders, or those of sequences.")
]
Out = Annotated[Path, typer.Option("--out", help="HTML file to write.")]


def report(
    results: Results,
    out: Out = Path("report.html"),
    truth: MaybeTruth = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Make the report of one result, or compare several."""
    with session(quiet, as_json, debug) as output:
        write_report(results, out, truth)
        output.print(f"{out}: open it in a browser.")
        output.summary({"report": str(out), "results": [str(r) for r in results]})


def write_report(results: list[Path], out: Path, truth: Path | None) -> None:
    """Write the report of solutions or sequences, with the truth given or that beside each.

    Raises:
        InputError: a file is missing or damaged, the truth is not that of its result, or ``out``
            is not called as a page is.
    """
    from ..errors import InputError
    from ..outputs import prepare_file
    from ..show.read_folder import read_solution_folder
    from ..show.read_sequence import keyframes_of, tracked_of
    from ..show.report import REPORT, save_report
    from ..show.truth import find_truth

    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError("a report is HTML", str(out), "give --out a name that ends in .html")
    read = [*results, *([truth] if truth else [])]
    prepare_file(out, [file for path in read for file in result_files(path)], [REPORT])
    folders = [keyframes_of(path) for path in results]
    calibrations = [read_solution_folder(path) for path in folders]
    truths = [
        truth or find_truth(path, calibration.solution)
        for path, calibration in zip(folders, calibrations, strict=True)
    ]
    named = list(zip(_names(results), calibrations, strict=True))
    save_report(out, named, truths=truths, tracks=[tracked_of(path) for path in results])


def _names(results: list[Path]) -> list[str]:
    """Return the folders' names, with as much of their paths as tells them apart."""
    folders = [(r.parent if r.name == "solution.json" else r).absolute() for r in results]
    for depth in range(1, max(len(f.parts) for f in folders) + 1):
        names = ["/".join(f.parts[-depth:]) for f in folders]
        if len(set(names)) == len(set(folders)):
            return names
    return [str(f) for f in folders]
