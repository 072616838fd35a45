"""Ways of an endoscope through an organ, and of its projector in its channel, as functions.

Adding one is a function here under ``@trajectory``.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from .transforms import RigidTransform, rotation_from_vector

Floats = NDArray[np.float64]
Trajectory = Callable[[int, np.random.Generator], list[RigidTransform]]
"""From a number of frames to first_from_camera of each, mm; the first is the identity."""
TRAJECTORIES: dict[str, Trajectory] = {}
"""By the name that ``render --trajectory`` takes."""

STEP = 0.5
"""Withdrawal from frame to frame, mm: 15 mm a second at 30 frames a second."""
RADIUS = 15.0
"""Of the circle of the pan, mm."""


def trajectory(name: str) -> Callable[[Trajectory], Trajectory]:
    """Register a motion."""

    def register(make: Trajectory) -> Trajectory:
        TRAJECTORIES[name] = make
        return make

    return register


@trajectory("withdrawal")
def withdrawal(count: int, rng: np.random.Generator, step: float = STEP) -> list[RigidTransform]:
    """Draw the camera back along its axis; it sways by a millimetre or so and some degrees."""
    sway = wander(count, 1.5 * 6, 1.2, rng), wander(count, 1.5 * 6, np.radians(3), rng)
    return [
        RigidTransform(rotation_from_vector(turn), move - [0, 0, step * k])
        for k, (move, turn) in enumerate(zip(*sway, strict=True))
    ]


@trajectory("pan")
def pan(count: int, _rng: np.random.Generator, radius: float = RADIUS) -> list[RigidTransform]:
    """Look at a wall from a circle that ends where it began."""
    around = 2 * np.pi * np.arange(count) / max(count - 1, 1)
    moves = radius * np.stack([np.cos(around) - 1, np.sin(around), 0.2 * np.sin(2 * around)], -1)
    turns = 0.01 * np.stack([-moves[:, 1], moves[:, 0], 0 * around], -1)
    return [
        RigidTransform(rotation_from_vector(turn), move)
        for turn, move in zip(turns, moves, strict=True)
    ]


def creeping(count: int, rng: np.random.Generator) -> list[RigidTransform]:
    """Return what a projector has moved by in its own axes: 2 mm and 5 degrees in 300 frames.

    It creeps along its channel, rolls and wobbles in it. The first is the identity.
    """
    along = np.cumsum(np.full(count, 2.0 / 300) + rng.normal(0, 0.01, count))
    roll = np.cumsum(np.full(count, np.radians(5) / 300) + rng.normal(0, 0.0005, count))
    tilt = wander(count, 10, 0.003, rng)
    wobble = wander(count, 10, 0.05, rng)
    return [
        RigidTransform.of(
            [tilt[k, 0], tilt[k, 1], roll[k] - roll[0]],
            [wobble[k, 0], wobble[k, 1], along[k] - along[0]],
        )
        for k in range(count)
    ]


def wander(count: int, frames: float, spread: float, rng: np.random.Generator) -> Floats:
    """Return (count, 3) smooth random motion that begins at zero.

    Args:
        count: frames.
        frames: over how many of them it changes.
        spread: standard deviation.
        rng: source of it.
    """
    white = rng.standard_normal((count + int(8 * frames), 3))
    smooth = gaussian_filter1d(white, frames, axis=0)
    smooth *= spread / smooth.std(axis=0)
    return smooth[:count] - smooth[0]
