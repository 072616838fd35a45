"""The problem of one frame, or of several frames that each have their own surface."""

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...records.correspondence import CorrespondenceMap
from ...start.result import Start
from ..cost.problem import Observations, Problem, curvature_prior, make_problem, prior_weight
from ..options import Options
from ..unknowns.lattice import Lattice, lattice_over
from ..unknowns.plan import Plan
from ..unknowns.state import State, intrinsics_vector
from .initial import cell_size, initial_rho, observations, smooth_samples


def separate_surfaces(
    maps: list[CorrespondenceMap],
    starts: list[Start],
    camera: CameraModel,
    plan: Plan,
    law: str,
    options: Options,
) -> tuple[Problem, State]:
    """Build a problem in which every frame has its own surface.

    Where the projector pose is shared, all starts hold the same one.
    """
    frames = [observations(m, s.used, camera) for m, s in zip(maps, starts, strict=True)]
    lattices, priors, rho = [], [], []
    for frame, start in zip(frames, starts, strict=True):
        lattice, inverse = _surface(frame, start, camera, options.cell_px)
        disparity = float(start.projector.focal * np.linalg.norm(start.projector_from_camera.t))
        lattices.append(lattice)
        density = frame.count / lattice.size
        priors.append(curvature_prior(lattice, prior_weight(density), disparity))
        rho.append(inverse)
    state = State(
        rho,
        [RigidTransform.identity() for _ in frames],
        [s.projector_from_camera for s in starts],
        [intrinsics_vector(s.projector) for s in starts],
    )
    return make_problem(frames, lattices, priors, plan, law), state


def _surface(
    frame: Observations, start: Start, camera: CameraModel, cell_px: float | None
) -> tuple[Lattice, NDArray[np.float64]]:
    lattice = lattice_over(frame.rays, cell_size(frame, camera, cell_px))
    return lattice, initial_rho(lattice, *smooth_samples(start.depth, frame))
