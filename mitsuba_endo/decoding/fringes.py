"""Coordinates from the phase images of an axis, unwrapped by its code or from period to period."""

import numpy as np
from numpy.typing import NDArray

from .axis_images import AxisImages
from .heterodyne import unwrap
from .phase_shift import MAX_DEVIATION, phase_noise, refine, unroll_coarsest, wrapped_coordinate
from .stack_plan import Axis, StackPlan


def fringe_coordinate(
    images: AxisImages,
    saturated: list[NDArray[np.bool_]],
    plan: StackPlan,
    axis: Axis,
    coarse: NDArray[np.float32] | None,
    noise: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return q along the axis, its standard deviation and the least contrast, all (...).

    Coordinates beyond the pattern are left as they are.

    Args:
        images: of the axis.
        saturated: (...) of each period, pixels of which an image is saturated.
        plan: of the stack.
        axis: which.
        coarse: coordinate of the code that tells the fringe; None: the coarsest period does.
        noise: standard deviation of the brightness.
    """
    q, all_fine = coarse, list[NDArray[np.float32]]()
    contrast = images.contrast
    spread = np.zeros_like(contrast)
    # A stripe that is one fringe tells its number; half of one tells which is nearer.
    most = 0.5 if plan.fringe_is_stripe else MAX_DEVIATION
    for period, waves, full in zip(plan.periods, images.waves, saturated, strict=True):
        fine, swing = wrapped_coordinate(waves, period, plan.phase)
        contrast = np.minimum(contrast, swing)
        spread = phase_noise(swing, noise, period, plan.steps).astype(np.float32)
        fine[full] = np.nan
        all_fine.append(fine)
        if plan.heterodyne:
            continue
        if q is None:
            q = unroll_coarsest(fine, period, plan.size[axis])
        else:
            q = refine(q, fine, period, most)
    if plan.heterodyne:
        q = unwrap(all_fine, plan.periods, plan.size[axis])
    assert q is not None, "a plan has a code or a period"
    return q, spread, contrast


def within(q: NDArray[np.float32], size: int, beyond: float = np.nan) -> NDArray[np.float32]:
    """Return coordinates with another value for those beyond a pattern of ``size`` pixels."""
    outside = (q < -0.5) | (q > size - 0.5)
    return np.where(outside, np.float32(beyond), q)
