"""Gross outliers, slips of the decoder, and the default start on random rigs."""

import sys
from functools import partial
from pathlib import Path

import numpy as np

from mitsuba_endo.geometry.transforms import angle_between
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.start.search import search_start

from .frames import make_frames
from .joint import errors
from .report import Figure

sys.path.insert(0, str(Path(__file__).parents[2]))  # the tests' rigs are truth that shares no code
from tests.rigs import random_rig, with_noise, with_outliers

NAME = "robustness"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Run all three."""
    pixels, seeds, rigs = (120, 2, 5) if quick else (240, 5, 100)
    return [
        *_corrupted("30 % outliers", seeds, pixels, outliers=0.3),
        *_corrupted("10 % slips", seeds, pixels, slips=0.1),
        _figure("default start right on random rigs", 100 * _starts(rigs), "%", "higher", 99),
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


def _starts(rigs: int) -> float:
    """Return the share of random rigs whose start is in the basin of the solver."""
    return float(np.mean([_right(seed) for seed in range(rigs)]))


def _right(seed: int) -> bool:
    """Tell whether the focal length is within 10 % and the translation within 10 degrees."""
    rig = with_outliers(with_noise(random_rig(seed), 0.2, seed), 0.05, seed)
    start = search_start(rig.q, rig.camera, rig.unknown_projector, rig.size, seed=seed)
    focal = float(start.projector.focal) / float(rig.projector.focal)
    turned = angle_between(start.projector_from_camera.t, rig.projector_from_camera.t)
    return abs(focal - 1) < 0.1 and np.degrees(turned) < 10
