"""The images of a stack to project."""

import numpy as np
from numpy.typing import NDArray

from .gray_code import bit_images
from .phase_shift import phase_images
from .stack_plan import AXES, Axis, StackPlan

SWING = 0.98
"""Of projected phase images, of full scale: a perfect copy of them must not look saturated."""


def patterns(plan: StackPlan) -> list[NDArray[np.uint8]]:
    """Return the images (height, width) to project, in the order of ``plan.labels()``."""
    flat = [255, 0] if plan.reference else []
    images = [np.full((plan.height, plan.width), value, np.uint8) for value in flat]
    for axis in AXES:
        for profile in profiles(plan, axis):
            line = np.rint(255 * profile).astype(np.uint8)
            across = line[None, :] if axis == "x" else line[:, None]
            images.append(np.broadcast_to(across, (plan.height, plan.width)).copy())
    return images


def profiles(plan: StackPlan, axis: Axis) -> NDArray[np.float32]:
    """Return the brightness along the axis of each of its images, (images, size)."""
    size, parts = plan.size[axis], []
    if plan.stripe:
        bits = bit_images(size, plan.stripe, plan.code)
        pairs = np.stack([bits, 1 - bits], 1).reshape(-1, size)
        parts.append(pairs if plan.inverse else bits)
    waves = [phase_images(size, period, plan.steps, plan.phase) for period in plan.periods]
    return np.concatenate(parts + [0.5 + SWING * (wave - 0.5) for wave in waves])
