"""Four frames of one sheet, every one with its own projector pose: accuracy, iterations, time."""

from functools import partial

import numpy as np

from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.solve.calibrate import calibrate

from .frames import Frames, make_frames, sheet_distances
from .report import Figure, timed
from .scene import TRUE_FOCAL

NAME = "joint"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Calibrate seed after seed; the worst counts."""
    pixels, seeds = (120, 2) if quick else (240, 10)
    calibrate((warm := make_frames(4, 99, pixels=pixels)).maps, warm.rig)
    found = [_one(make_frames(4, seed, pixels=pixels)) for seed in range(seeds)]
    focal, baseline, shape, iterations, seconds, kept = np.array(found).T
    return [
        _figure("seeds", seeds, "", ""),
        _figure("focal error, worst", focal.max(), "%", "lower", 0.1),
        _figure("focal error, median", float(np.median(focal)), "%", "lower"),
        _figure("baseline error, worst of all frames", baseline.max(), "%", "lower", 0.5),
        _figure("baseline error, median of the seeds' worst", float(np.median(baseline)), "%",
                "lower"),
        _figure("shape RMSE, worst", shape.max(), "mm", "lower", 0.12),
        _figure("joint iterations, worst", iterations.max(), "", "lower", 12),
        _figure("frames used, least", kept.min(), "of 4", "higher", 4),
        _figure("time, worst", seconds.max(), "s", "lower", 15),
        _figure("time, median", float(np.median(seconds)), "s", "lower"),
    ]  # fmt: skip


def _one(frames: Frames) -> list[float]:
    seconds, found = timed(lambda: calibrate(frames.maps, frames.rig))
    focal, baseline = errors(frames, found)
    shape = float(np.sqrt(np.mean(sheet_distances(found.surface.vertices) ** 2)))
    return [focal, baseline, shape, len(found.trace), seconds, len(found.frames)]


def errors(frames: Frames, found: Calibration) -> tuple[float, float]:
    """Return the errors of focal length and of the worst baseline, %; infinite if not given."""
    focal = found.solution.projector.focal.value
    names = [m.name for m in frames.maps]
    worst = 0.0
    for frame in found.solution.frames:
        t = frame.projector_from_camera.t
        true = frames.baselines[names.index(frame.name)]
        worst = max(worst, np.inf if t is None else abs(float(np.linalg.norm(t)) / true - 1))
    return np.inf if not isinstance(focal, float) else 100 * abs(
        focal / TRUE_FOCAL - 1
    ), 100 * worst
