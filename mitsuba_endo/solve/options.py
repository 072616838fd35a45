"""How to solve, as opposed to what is known (the rig) and what was seen (the maps)."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from ..records.validation import Count, Length, Seed, check_fields


@dataclass(frozen=True)
class Options:
    """Options of :func:`mitsuba_endo.solve.calibrate.calibrate`.

    Raises:
        InputError: a value that means nothing, when they are made; the solver's name only when it
            is called, since others may be registered.
    """

    solver: str = "levenberg-marquardt"
    """A registered minimiser: ``levenberg-marquardt`` (``gauss-newton`` is its old name), or the
    published first-order ``adam``."""
    start: Literal["search", "plane"] = "search"
    """``search`` needs no guess; ``plane`` is the published plane and front-parallel projector."""
    cameras: Literal["registration", "identity"] = "registration"
    """Start of the camera poses of several frames: registration of the surfaces that each frame
    alone shows, or all cameras at the same place."""
    surface: Literal["lattice", "mesh"] = "lattice"
    """Common surface of several frames: one range for each direction from the first camera, or a
    triangle mesh fused from what each frame sees, for folds and for cameras that travel."""
    plane_distance: Length = 10.0
    """Distance of the starting plane, in baselines (start = plane)."""
    max_iterations: Count = 60
    """Limit for Levenberg-Marquardt."""
    adam_iterations: Count = 20_000
    """Limit for Adam."""
    tolerance: Annotated[float, Field(gt=0)] = 0.2
    """Converged when a step is below this many standard deviations of the unknowns."""
    cell_px: Length | None = None
    """Size of a surface cell, camera pixels; default: chosen from the number of observations."""
    smoothness: Annotated[float, Field(ge=0)] = 1.0
    """Multiplies the weight of the curvature prior on the reported surface; the calibration is not
    affected."""
    finish: Literal["tukey", "cauchy"] = "tukey"
    """Loss of the last stage: redescending, or Cauchy as published."""
    seed: Seed = 0
    """Of the random samples in the search for a start."""
    check_model: bool = True
    """Whether to test the model against its residuals, name what of it may be wrong, and carry that
    into estimates and intervals."""
    jackknife: bool = True
    """Whether to compute block-jackknife standard deviations."""

    def __post_init__(self) -> None:
        """Refuse values that mean nothing."""
        check_fields(self, "options")
