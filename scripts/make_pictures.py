"""Make the pictures of the README and the documentation.

python scripts/make_pictures.py --out docs/images

Report and viewer are photographed in Chromium, where there is one.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np
import typer
from benchmarks.chromium import EXECUTABLE, browser
from matplotlib.figure import Figure

from mitsuba_endo import backend
from mitsuba_endo.rendering.render import render_capture
from mitsuba_endo.rendering.scene import load_scene, packaged_scenes
from mitsuba_endo.show.figures import save_figure
from mitsuba_endo.show.read_folder import read_solution_folder
from mitsuba_endo.show.report import save_report
from mitsuba_endo.show.tonemap import tonemap
from mitsuba_endo.show.truth import find_truth
from mitsuba_endo.show.viewer import address, open_viewer, running_server

WIDTH, HEIGHT = 1240, 930
SETTLE = 10.0
"""Seconds that software WebGL needs to draw."""


def main(
    out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("docs/images"),
    result: Annotated[
        Path | None, typer.Option(help="Only the pictures of this result of the demo.")
    ] = None,
) -> None:
    """Run the demo and show its result; render every packaged scene."""
    out.mkdir(parents=True, exist_ok=True)
    if result is not None:
        _result(result, out)
        return
    with tempfile.TemporaryDirectory() as folder:
        demo = Path(folder) / "demo"
        command = [sys.executable, "-m", "mitsuba_endo", "demo", "--out", str(demo)]
        subprocess.run([*command, "--quiet"], check=True)
        _result(demo / "solution", out)
    _scenes(out)


def _result(result: Path, out: Path) -> None:
    (out / "overview.png").write_bytes((result / "overview.png").read_bytes())
    if EXECUTABLE is None:
        print("no Chromium: report.png and viewer.png are left as they are")
        return
    _report(result, out)
    _viewer(result, out)


def _report(result: Path, out: Path) -> None:
    """Show the top of the report with its truth, and below it the rig in space."""
    calibration = read_solution_folder(result)
    with tempfile.TemporaryDirectory() as folder, browser(WIDTH, 700) as page:
        path = Path(folder) / "report.html"
        truths = [find_truth(result, calibration.solution)]
        save_report(path, [(result.name, calibration)], truths=truths)
        page.open(path.as_uri())
        time.sleep(1)
        parts = []
        for first, last, above in (("h1", ".viewer", 20), (".space", ".space", 60)):
            top, bottom = page.evaluate(
                f"[document.querySelector('{first}').getBoundingClientRect().top - {above}, "
                f"document.querySelector('{last}').getBoundingClientRect().bottom + 20]"
            )
            page.screenshot(Path(folder) / "part.png", (top, bottom))
            parts.append(cv2.imread(str(Path(folder) / "part.png")))
    picture = np.concatenate(parts)
    smaller = cv2.resize(picture, None, fx=0.8, fy=0.8, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(out / "report.png"), smaller, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def _viewer(result: Path, out: Path) -> None:
    calibration = read_solution_folder(result)
    with running_server("localhost", 8090) as server, browser(WIDTH, HEIGHT) as page:
        viewer = open_viewer(server, calibration, find_truth(result, calibration.solution))
        page.open(address(server))
        page.wait_for("document.body.innerText.includes('Measure')", 60)
        # A notice about software WebGL lies over the scene.
        page.evaluate("document.querySelector('.mantine-Notification-closeButton')?.click()")
        viewer.controls.boxes["rays"].value = True
        camera = calibration.camera
        corner = np.array([camera.width, camera.height], float)
        for place in ((0.3, 0.25), (0.55, 0.8)):
            viewer.controls.measure_along(camera.rays(corner * place))
        time.sleep(SETTLE)
        page.screenshot(out / "viewer.png")


def _scenes(out: Path) -> None:
    backend.use()
    names = packaged_scenes()
    columns = 3
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(9, 2.45 * rows), dpi=90, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for place in axes:
        place.set_axis_off()
    for place, name in zip(axes, names, strict=False):
        capture = render_capture(load_scene(name), spp=64)
        place.imshow(tonemap(capture.image))
        place.set_title(name)
    save_figure(out / "scenes.png", figure)


if __name__ == "__main__":
    typer.run(main)
