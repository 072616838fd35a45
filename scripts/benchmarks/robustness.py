"""Gross outliers and slips of the decoder."""

from functools import partial

import numpy as np

from mitsuba_endo.geometry.transforms import angle_between
from mitsuba_endo.solve.calibrate import calibrate

from .frames import make_frames
from .joint import errors
from .report import Figure

NAME = "robustness"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Run both."""
    pixels, seeds = (120, 2) if quick else (240, 5)
    return [
        *_corrupted("30 % outliers", seeds, pixels, outliers=0.3),
        *_corrupted("10 % slips", seeds, pixels, slips=0.1),
    ]


def _corrupted(name: str, seeds: int, pixels: int, **how: float) -> list[Figure]:
    """Calibrate one frame, seed after seed; the worst counts."""
    focal, direction = [], []
    for seed in range(seeds):
        frames = make_frames(1, seed, pixels=pixels, **how)
        found = calibrate(frames.maps, frames.rig)
        t = found.solution.frames[0].projector_from_camera.t
        true = frames.projector_from_camera[0].t
        focal.append(errors(frames, found)[0])
        direction.append(np.inf if t is None else np.degrees(angle_between(np.array(t), true)))
    return [
        _figure(f"{name}: focal error, worst of {seeds}", max(focal), "%", "lower", 0.3),
        _figure(f"{name}: translation direction error, worst of {seeds}", max(direction), "deg",
                "lower", 0.5),
    ]  # fmt: skip
