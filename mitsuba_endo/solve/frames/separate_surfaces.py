"""The problem of one frame, or of several frames that each have their own surface."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...initialisation.result import Start
from ...records.correspondence import CorrespondenceMap
from ...records.rig import Rig
from ..costs.coordinate_residual import Observations
from ..costs.objective import Problem, make_problem
from ..costs.registry import priors_of
from ..costs.smoothness import prior_weight, smoothness
from ..options import Options
from ..surfaces.inverse_range_lattice import Lattice, lattice_over
from ..unknowns.block import Value
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .initial_state import cell_size, initial_rho, observations, smooth_samples


def separate_surfaces(
    maps: Sequence[CorrespondenceMap],
    starts: Sequence[Start],
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
    law: str,
    options: Options,
) -> tuple[Problem, State]:
    """Build a problem in which every frame has its own surface."""
    frames = [observations(m, s.used, camera) for m, s in zip(maps, starts, strict=True)]
    lattices, terms, values = [], [], []
    for k, (frame, start) in enumerate(zip(frames, starts, strict=True)):
        lattice, rho = _surface(frame, start, camera, options.cell_px)
        disparity = float(start.projector.focal * np.linalg.norm(start.projector_from_camera.t))
        weight = prior_weight(lattice, frame.count)
        terms.append(smoothness(lattice, k, weight, disparity))
        lattices.append(lattice)
        values.append(rho)
    state = layout.state(values, of_starts(starts))
    terms += priors_of(rig, layout)
    return make_problem(frames, lattices, state, layout, law, terms), state


def of_starts(starts: Sequence[Start]) -> dict[str, list[Value]]:
    """Return the values of the blocks that every start found."""
    return {
        "camera_pose": [RigidTransform.identity() for _ in starts],
        "projector_pose": [s.projector_from_camera for s in starts],
        "focal": [np.log([float(s.projector.focal)]) for s in starts],
        "centre": [np.array(s.projector.centre, float) for s in starts],
    }


def _surface(
    frame: Observations, start: Start, camera: CameraModel, cell_px: float | None
) -> tuple[Lattice, NDArray[np.float64]]:
    lattice = lattice_over(frame.rays, cell_size(frame, camera, cell_px))
    return lattice, initial_rho(lattice, *smooth_samples(start.depth, frame))
