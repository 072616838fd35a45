"""What a start should tell its user about the data."""

import numpy as np

from .choose import REDESCENDING, SIMILAR_COST, Minimum, robust_scale
from .correspondences import Correspondences
from .epipolar_refinement import EpipolarLoss, EpipolarState, focal_deviation
from .triangulate import ranges
from .vectors import Vectors

WEAK_FOCAL = 0.02
"""Relative formal standard deviation from which the focal length is called undetermined."""
PLANAR = 3.0
"""Data whose 90th percentile distance from one plane is below this many residual scales count as
planar."""


def remarks(minima: list[Minimum], data: Correspondences, refine_focal: bool) -> list[str]:
    """Return sentences about the chosen minimum (the first) and its competitors."""
    best, focal = minima[0].state, minima[0].state.projector.focal
    similar = [m.state.projector.focal for m in minima[1:]
               if m.cost <= SIMILAR_COST * minima[0].cost]  # fmt: skip
    notes = []
    if is_planar(best, data):
        notes.append("The seen surface is nearly one plane.")
    if similar:
        notes.append(
            f"{_count(len(similar), 'other pose fits', 'other poses fit')} about as well; see the "
            "alternatives. Among equals the one with the smallest rotation was taken."
        )
    if refine_focal:
        loss = EpipolarLoss(True, REDESCENDING * robust_scale(best))
        deviation = focal_deviation(best, data, loss)
        low, high = min([focal, *similar]), max([focal, *similar])
        if high > (1 + 2 * WEAK_FOCAL) * low:
            notes.append(
                f"The focal length is not determined: {low:.4g} to {high:.4g} px fit about as well."
            )
        elif not deviation < WEAK_FOCAL:
            notes.append(
                "The focal length is hardly determined: formal standard deviation "
                f"{100 * deviation:.1g} %."
            )
    return notes


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def is_planar(state: EpipolarState, data: Correspondences) -> bool:
    """Tell whether one plane explains the data about as well as the epipolar fit.

    On a plane the inverse range is linear in the ray: 1 / lambda = n . d. The fit is weighted to
    distances in pattern pixels.
    """
    scale = robust_scale(state)
    inverse = 1 / ranges(state.pose, state.bearings, state.at)[0]
    near = (np.abs(state.r) < 5 * scale) & np.isfinite(inverse)
    rays, inverse = data.rays[:, near], inverse[near]
    if inverse.size < 10:
        return False
    per_px = _inverse_range_per_px(state, rays, inverse)
    distance = np.zeros_like(inverse)
    for _ in range(3):
        weight = 1 / (per_px * np.sqrt(1 + (distance / (PLANAR * scale)) ** 2))
        n = np.linalg.lstsq((rays * weight).T, inverse * weight, rcond=None)[0]
        distance = (n @ rays - inverse) / per_px
    return float(np.percentile(np.abs(distance), 90)) < PLANAR * scale


def _inverse_range_per_px(state: EpipolarState, rays: Vectors, inverse: Vectors) -> Vectors:
    """Return the change of inverse range that moves q by one pattern pixel, (N,)."""
    h = 1e-6 * float(np.median(np.abs(inverse)))
    turned, t = state.pose.R @ rays, state.pose.t[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        a = np.stack(state.projector.project_xyz(*(turned + t * (inverse - h))))
        b = np.stack(state.projector.project_xyz(*(turned + t * (inverse + h))))
        step = 2 * h / np.hypot(*(b - a))
    return np.where(np.isfinite(step), step, np.inf)
