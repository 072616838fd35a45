"""Make the pictures of the README and the documentation.

python scripts/make_pictures.py --out docs/images

Report and viewer are photographed in Chromium, where there is one.
"""

import subprocess
import sys
import tempfile
import time
from functools import partial
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
IMAGES, SWING = 30, 75
"""Of the turning surface, and how far the mouse turns it to either side, pixels."""
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
    if EXECUTABLE is None:
        print("no Chromium: report.png and viewer.png are left as they are")
        return
    _seen(result, out)
    _turning(result, out)
    _report(result, out)
    _viewer(result, out)


def _seen(result: Path, out: Path) -> None:
    """Write the photograph from which the result was made."""
    calibration = read_solution_folder(result)
    image = calibration.photographs[calibration.frames[0].name]
    cv2.imwrite(str(out / "seen.png"), np.ascontiguousarray(image[..., ::-1]))


def _turning(result: Path, out: Path) -> None:
    """Write the report's scene, swinging to and fro, as a short GIF."""
    from PIL import Image

    swing = np.round(SWING * np.sin(2 * np.pi * np.arange(IMAGES + 1) / IMAGES)).astype(int)
    pictures = []
    with tempfile.TemporaryDirectory() as folder, browser(760, 900) as page:
        page.open((result / "report.html").absolute().as_uri())
        time.sleep(1)
        page.evaluate("document.querySelector('.space [name=axes]').click()")
        left, top, right, bottom = page.evaluate(
            "(() => { const r = document.querySelector('canvas.scene').getBoundingClientRect();"
            "return [r.left, r.top, r.right, r.bottom]; })()"
        )
        page.send("Input.dispatchMouseEvent", type="mouseWheel", x=left + 50, y=top + 50,
                  deltaX=0, deltaY=160)  # fmt: skip
        x, y = (left + right) / 2, (top + bottom) / 2
        mouse = partial(page.send, "Input.dispatchMouseEvent", y=y, button="left")
        mouse(type="mousePressed", x=x, clickCount=1)
        for shift in swing[:-1]:
            mouse(type="mouseMoved", x=x + float(shift), buttons=1)
            time.sleep(0.15)
            page.screenshot(Path(folder) / "part.png", (top, bottom))
            with Image.open(Path(folder) / "part.png") as picture:
                inside = picture.crop((int(left) + 1, 1, int(right) - 1, int(bottom - top) - 1))
                small = inside.convert("RGB").resize((inside.width // 2, inside.height // 2))
                pictures.append(small.quantize(64))
    pictures[0].save(
        out / "turning.gif", save_all=True, append_images=pictures[1:], duration=90, loop=0
    )


def _report(result: Path, out: Path) -> None:
    """Show the top of the report: verdict, scene, photograph and maps."""
    calibration = read_solution_folder(result)
    with tempfile.TemporaryDirectory() as folder, browser(WIDTH, 700) as page:
        path = Path(folder) / "report.html"
        truths = [find_truth(result, calibration.solution)]
        save_report(path, [(result.name, calibration)], truths=truths)
        page.open(path.as_uri())
        time.sleep(1)
        bottom = page.evaluate(
            "document.querySelector('.viewer').getBoundingClientRect().bottom + 20"
        )
        page.screenshot(Path(folder) / "part.png", (0, bottom))
        picture = cv2.imread(str(Path(folder) / "part.png"))
        assert picture is not None
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
