"""Stopping an optimisation and going on with it later."""

import numpy as np

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...records.checkpoint import Checkpoint
from ...records.correspondence import CorrespondenceMap
from ..cost.problem import Problem, curvature_prior, make_problem
from ..optimise.optimum import Optimum
from ..unknowns.lattice import Lattice
from ..unknowns.plan import Plan
from ..unknowns.state import State
from .initial import observations


def checkpoint_of(optimum: Optimum) -> Checkpoint:
    """Describe an optimum, or where an interrupted optimisation stood."""
    problem, state = optimum.objective.problem, optimum.state
    priors = [s.prior for s in problem.surfaces]
    used = []
    for frame in problem.frames:
        mask = np.zeros(frame.shape, bool)
        mask[frame.pixels[:, 1], frame.pixels[:, 0]] = True
        used.append(mask)
    return Checkpoint(
        law=problem.law,
        stage=optimum.objective.stage,
        names=[f.name for f in problem.frames],
        used=used,
        cells=[s.lattice.cell for s in problem.surfaces],
        lattices=[s.lattice.ij for s in problem.surfaces],
        faces=[s.lattice.faces for s in problem.surfaces],
        weights=[p.weight for p in priors],
        disparities=[p.disparity for p in priors],
        rho=state.rho,
        world_from_camera=state.world_from_camera,
        projector_from_camera=state.projector_from_camera,
        intrinsics=state.intrinsics,
    )


def resumed_problem(
    checkpoint: Checkpoint,
    maps: list[CorrespondenceMap],
    camera: CameraModel,
    plan: Plan,
) -> tuple[Problem, State]:
    """Rebuild the problem of a checkpoint from its maps.

    Raises:
        InputError: the plan asks for other surfaces than the checkpoint has.
    """
    if plan.surfaces != len(checkpoint.rho):
        raise InputError(
            f"the earlier calibration had {len(checkpoint.rho)} surfaces and the plan asks for "
            f"{plan.surfaces}", "share.surface", "resume with the same plan, or start anew",
        )  # fmt: skip
    frames = [observations(m, used, camera) for m, used in zip(maps, checkpoint.used, strict=True)]
    parts = zip(checkpoint.cells, checkpoint.lattices, checkpoint.faces, strict=True)
    lattices = [Lattice(cell, ij, faces) for cell, ij, faces in parts]
    priors = [
        curvature_prior(*parts)
        for parts in zip(lattices, checkpoint.weights, checkpoint.disparities, strict=True)
    ]
    state = State(
        checkpoint.rho, checkpoint.world_from_camera, checkpoint.projector_from_camera,
        checkpoint.intrinsics,
    )  # fmt: skip
    return make_problem(frames, lattices, priors, plan, checkpoint.law), state


def resumed_maps(checkpoint: Checkpoint, maps: list[CorrespondenceMap]) -> list[CorrespondenceMap]:
    """Return the maps of the checkpoint's frames, in its order.

    Raises:
        InputError: a frame is not among the maps, or has another size.
    """
    named = {m.name: m for m in maps}
    out = []
    for name, used in zip(checkpoint.names, checkpoint.used, strict=True):
        if name not in named:
            raise InputError("a frame of the earlier calibration is missing", name, "give its map")
        if named[name].q.shape[:2] != used.shape or not named[name].valid[used].all():
            raise InputError("is not the map of the earlier calibration", name, "give that map")
        out.append(named[name])
    return out
