"""Report of four frames: size and time; viewer: time until a surface of 200,000 triangles stands.

The viewer is timed as its user waits: a process of its own from its start to the printed address,
and then Chromium (where there is one) from asking for the page to the surface on the screen. Its
processor time, which other work on the machine does not lengthen, is told too.
"""

import contextlib
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_endo.records.calibration import Calibration, SurfaceEstimate
from mitsuba_endo.show.report import save_report
from mitsuba_endo.show.solution_folder import write_solution_folder
from mitsuba_endo.solve.calibrate import calibrate

from .chromium import EXECUTABLE, Page, browser
from .frames import make_frames
from .report import Figure, timed

NAME = "pages"
_figure = partial(Figure, NAME)
FRAMES, PIXELS, TRIANGLES, REPEATS = 4, 480, 200_000, 3


def run(quick: bool) -> list[Figure]:
    """Calibrate frames once; make their report and view them on a fine surface."""
    frames, pixels, triangles = (2, 80, 20_000) if quick else (FRAMES, PIXELS, TRIANGLES)
    made = make_frames(frames, 0, pixels=pixels)
    calibration = calibrate(made.maps, made.rig)
    with tempfile.TemporaryDirectory() as folder:
        return [*_report(calibration, Path(folder)), *_viewer(calibration, triangles, Path(folder))]


def _report(calibration: Calibration, folder: Path) -> list[Figure]:
    path = folder / "report.html"
    seconds = [timed(lambda: save_report(path, [("x", calibration)]))[0] for _ in range(REPEATS)]
    height, width = calibration.frames[0].observed.shape[:2]
    of = f"of {len(calibration.frames)} frames of {width} x {height}"
    return [
        _figure(f"report {of}, size", path.stat().st_size / 1e6, "MB", "lower", 6),
        _figure(f"report {of}, time", min(seconds), "s", "lower", 5),
    ]


def _viewer(calibration: Calibration, triangles: int, folder: Path) -> list[Figure]:
    fine = replace(calibration, surface=refined(calibration.surface, triangles))
    write_solution_folder(folder / "fine", fine)
    starts, pages = zip(*(_opened(folder / "fine") for _ in range(REPEATS)), strict=True)
    count = f"viewer, {len(fine.surface.faces)} triangles"
    work = min(_processor_time(folder / "fine") for _ in range(REPEATS))
    out = [
        _figure(f"{count}: command to scene ready", min(starts), "s", "lower", 2),
        _figure(f"{count}: processor time of that", work, "s", "lower"),
    ]
    if EXECUTABLE is not None:
        out.append(
            _figure(f"{count}: page to surface shown, software WebGL", min(pages), "s", "lower")
        )
    return out


def refined(surface: SurfaceEstimate, triangles: int) -> SurfaceEstimate:
    """Return a surface split into four triangles each until there are enough, then cut to size."""
    import trimesh

    if surface.std is None or surface.modes is None:
        raise ValueError("the surface has no standard deviations or modes")
    columns: Any = np.column_stack([surface.vertices, surface.std, surface.modes])
    faces: Any = surface.faces
    while len(faces) < triangles:
        columns, faces = trimesh.remesh.subdivide(columns, faces)[:2]
    used, faces = np.unique(faces[:triangles], return_inverse=True)
    kept = np.asarray(columns[used], np.float64)
    return SurfaceEstimate(kept[:, :3], faces.reshape(-1, 3), kept[:, 3], kept[:, 4:])


@contextlib.contextmanager
def _viewing(folder: Path) -> Iterator[str]:
    """Run the viewer and yield its address when it is printed."""
    command = [sys.executable, "-m", "mitsuba_endo", "view", str(folder), "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split(": ")[0]
    finally:
        process.terminate()
        process.wait(20)


def _opened(folder: Path) -> tuple[float, float]:
    """Return the seconds until the address is printed, and those until the surface is shown."""
    began = time.perf_counter()
    with _viewing(folder) as address:
        started = time.perf_counter() - began
        if EXECUTABLE is None:
            return started, np.nan
        with browser(1200, 800) as page:
            began = time.perf_counter()
            page.open(address)
            _wait_for_surface(page)
            return started, time.perf_counter() - began


def _processor_time(folder: Path) -> float:
    """Return the seconds of processor time until the address is printed."""
    before = _of_children()
    with _viewing(folder):
        pass
    return _of_children() - before


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _wait_for_surface(page: Page) -> None:
    """Wait until a tenth of the middle of the window is not background."""
    import cv2

    with tempfile.TemporaryDirectory() as folder:
        for _ in range(300):
            path = Path(folder) / "page.png"
            page.screenshot(path)
            image = cv2.imread(str(path))
            assert image is not None
            if (image[200:600, 100:700].min(-1) < 200).mean() > 0.1:
                return
    raise RuntimeError("the viewer shows no surface")
