"""What a start hands to the solver."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform


@dataclass(frozen=True, eq=False)
class Candidate:
    """One minimum of the epipolar cost."""

    projector_from_camera: RigidTransform
    """|t| = 1: the unit of length is the baseline."""
    focal: float
    """Pattern pixels."""
    cost: float
    """Mean robust cost per correspondence in units of the squared residual scale: 0.5 is a perfect
    fit's order of magnitude, values are comparable within one start only."""
    in_front: float
    """Share of the correspondences whose triangulated point is not behind camera or projector."""


@dataclass(frozen=True, eq=False)
class Start:
    """Calibration and surface from which a solver can start, free of scale."""

    projector: ProjectorModel
    """Intrinsics with the focal length filled in."""
    projector_from_camera: RigidTransform
    """|t| = 1: the unit of length of a start is the baseline."""
    depth: NDArray[np.float64]
    """(H, W) range along the unit camera ray, baselines: point = depth * ray. NaN = not seen or
    rejected."""
    used: NDArray[np.bool_]
    """(H, W) correspondences kept by the cleaning and the robust fit."""
    scale_px: float
    """Robust standard deviation of the epipolar residuals, pattern pixels."""
    noise_px: float = 0.0
    """Noise of q as the map itself shows it, pattern pixels; 0 where it was not looked at."""
    notes: list[str] = field(default_factory=list)
    """What the user should know: nearly planar data, a twin pose, a focal length the data do not
    determine."""
    alternatives: list[Candidate] = field(default_factory=list)
    """Competing minima, best first; the chosen one is not among them."""
