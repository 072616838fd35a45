"""Everything a calibration hands on: the solution and the arrays that belong to it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.transforms import RigidTransform
from .checkpoint import Checkpoint
from .solution import Solution


@dataclass(frozen=True, eq=False)
class SurfaceEstimate:
    """Triangle mesh of what the frames saw, in the first camera's frame."""

    vertices: NDArray[np.float64]
    """(V, 3) in the solution's unit."""
    faces: NDArray[np.int64]
    """(F, 3) vertex indices."""
    std: NDArray[np.float64] | None = None
    """(V,) standard deviation along the viewing direction, same unit; None if not computed."""
    modes: NDArray[np.float64] | None = None
    """(V, K) the part of ``std`` that all vertices share, because it comes from the calibration:
    the covariance of two vertices' errors along their directions is the product of their rows,
    and what is left of their variances is their own. Without the unit's own uncertainty."""


@dataclass(frozen=True, eq=False)
class FrameMaps:
    """Images of one frame."""

    name: str
    observed: NDArray[np.float32]
    """(H, W, 2) observed projector coordinates, pattern pixels, NaN = missing."""
    rendered: NDArray[np.float32]
    """(H, W, 2) projector coordinates rendered from the solution, NaN = not seen."""
    used: NDArray[np.bool_]
    """(H, W) correspondences that the solver used."""

    @property
    def residual(self) -> NDArray[np.float32]:
        """(H, W, 2) observed minus rendered, pattern pixels."""
        return self.observed - self.rendered


@dataclass(frozen=True)
class TraceRow:
    """One iteration of the solver, a line of ``trace.csv``."""

    iteration: int
    seconds: float
    """Since the start of the optimisation."""
    cost: float
    """Robust cost per correspondence, in units of the noise scale squared."""
    focal: float | None
    """Pattern pixels; None when it is per frame."""
    damping: float
    scale_px: float
    """Scale of the robust loss, pattern pixels."""
    step: float
    """Largest change of an unknown in this iteration, relative to its own scale."""
    fixed_cost: float | None = None
    """As ``cost``, of the correspondences alone, under the loss that ended the optimisation."""
    lengths: tuple[float, ...] = ()
    """Quantiles of the whitened residuals' lengths, pattern pixels, missed ones infinite: from them
    ``fixed_cost`` is made at the end. Not saved."""


@dataclass(frozen=True, eq=False)
class Snapshot:
    """Where the optimisation stood after an iteration; surfaces are coarse."""

    iteration: int
    """0 is the start."""
    cost: float | None
    """As in :class:`TraceRow`; None at the start."""
    scale_px: float | None
    """Likewise."""
    focal: list[float]
    """Of every frame, pattern pixels."""
    surfaces: list[NDArray[np.float64]]
    """(V, 3) vertices of every surface, the frame of its first camera."""
    faces: list[NDArray[np.int64]]
    """(F, 3) triangles of every surface; the same list for snapshots of the same mesh."""
    world_from_camera: list[RigidTransform]
    projector_from_camera: list[RigidTransform]
    """Of every frame."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of :func:`mitsuba_endo.solve.calibrate.calibrate`."""

    solution: Solution
    camera: CameraModel
    surface: SurfaceEstimate
    frames: Sequence[FrameMaps]
    trace: list[TraceRow] = field(default_factory=list)
    checkpoint: Checkpoint | None = None
    """From which the optimisation can go on."""
    own_surfaces: dict[int, SurfaceEstimate] = field(default_factory=dict)
    """Where frames do not share a surface: those of the frames after the first, by index, each in
    its camera's frame."""
    history: list[Snapshot] = field(default_factory=list)
    """How the optimisation went, the solution's unit."""
    photographs: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)
    """What the camera saw, (H, W, 3) RGB, by the frames' names, where maps come from images."""
