"""The problem of several frames that share one surface, a lattice around the first camera."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...geometry.transforms import RigidTransform
from ...initialisation.registration import Registration
from ...records.rig import Rig
from ..costs.objective import Problem, make_problem
from ..costs.registry import priors_of
from ..costs.smoothness import prior_weight, smoothness
from ..inference.fit import FrameSolution
from ..minimisers.result import OptimisationResult
from ..surfaces.inverse_range_lattice import Lattice, lattice_over
from ..unknowns.block import BLOCKS, Value
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .initial_state import initial_rho

MARGIN = 3
"""Cells added around what the frames see: small steps of the cameras then stay on the surface."""
FINEST = 0.5
"""Least spacing of the common surface relative to that of the first frame alone: half of it
quadruples the vertices."""
MISSED_SHARE = 0.01
"""Share of rays that miss the surface from which on it is grown."""


def joint_problem(
    frames: Sequence[FrameSolution],
    registered: Sequence[Registration],
    rig: Rig,
    layout: Layout,
    law: str,
) -> tuple[Problem, State]:
    """Build the joint problem of frames that were registered; the first one is the world.

    Args:
        frames: the frames solved alone.
        registered: where each is, in units of the first one's baseline.
        rig: what is known.
        layout: of the unknowns.
        law: name of the projector's projection model.
    """
    points = np.concatenate(
        [
            p.world_from_camera.apply(p.scale * f.points)
            for f, p in zip(frames, registered, strict=True)
        ]
    )
    ranges = np.linalg.norm(points, axis=1)
    directions = points / ranges[:, None]
    lattice = lattice_over(directions, _cell(frames, registered), MARGIN)
    state = layout.state(
        [initial_rho(lattice, directions, ranges)], registered_values(frames, registered)
    )
    weight = prior_weight(lattice, sum(f.observations.count for f in frames))
    terms = [smoothness(lattice, 0, weight, disparity_of(state)), *priors_of(rig, layout)]
    observed = [f.observations for f in frames]
    return make_problem(observed, [lattice], state, layout, law, terms), state


def registered_values(
    frames: Sequence[FrameSolution], registered: Sequence[Registration]
) -> dict[str, list[Value]]:
    """Return what every frame found alone, in the common unit of length and the common world."""
    values = {name: [f.state.at(name, 0) for f in frames] for name in BLOCKS}
    values["camera_pose"] = [p.world_from_camera for p in registered]
    values["projector_pose"] = [
        RigidTransform(pose.R, pose.t * p.scale)
        for pose, p in zip(values["projector_pose"], registered, strict=True)
    ]
    return values


def disparity_of(state: State) -> float:
    """Return focal length times baseline of the first frame, pattern pixels times baselines."""
    return state.focals[0] * float(np.linalg.norm(state.at("projector_pose", 0).t))


def _cell(frames: Sequence[FrameSolution], registered: Sequence[Registration]) -> float:
    """Return the lattice spacing, radians, that keeps the detail of the frame that is nearest.

    What a cell of that frame spans is seen under a smaller angle from the first camera.
    """
    ratios = [1.0]
    for frame, registration in zip(frames, registered, strict=True):
        near = registration.scale * frame.points
        far = registration.world_from_camera.apply(near)
        ratios.append(float(np.median(np.linalg.norm(near, axis=1) / np.linalg.norm(far, axis=1))))
    return frames[0].cell * max(min(ratios), FINEST)


def extended(result: OptimisationResult) -> tuple[Problem, State] | None:
    """Return the problem with a surface grown to where cameras have moved, or None if it fits.

    Rays that miss the surface are taken to end at their frame's median range.
    """
    old, state = result.problem, result.state
    lattice, (term,) = old.surfaces[0], old.smoothness
    missing = [_missed_points(result, k) for k in range(old.layout.frames)]
    few = sum(len(m) for m in missing) < MISSED_SHARE * old.observations
    if few or not isinstance(lattice, Lattice):
        return None
    points = np.concatenate([lattice.vertices(state.surfaces[0]), *missing])
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    grown = lattice_over(directions, lattice.cell, 1)
    at = grown.nearest(lattice.directions)
    rho, covered = np.zeros(grown.size), np.zeros(grown.size, bool)
    rho[at], covered[at] = state.surfaces[0], True
    state = state.with_surfaces(grown.fill(covered, rho))
    terms = [
        smoothness(grown, 0, term.weight, term.disparity),
        *(t for t in old.others if t is not term),
    ]
    return make_problem(old.observed, [grown], state, old.layout, old.law, terms), state


def _missed_points(result: OptimisationResult, frame: int) -> NDArray[np.float64]:
    """Return where (N, 3) rays that miss the surface are taken to end, in the world."""
    at, state = result.evaluation.frames[frame], result.state
    if at.hits.all():
        return np.zeros((0, 3))
    median = (
        float(np.median(at.distance[at.hits]))
        if at.hits.any()
        else result.problem.surfaces[0].typical_range(state.surfaces[0])
    )
    rays = result.problem.rays(state, frame)[~at.hits]
    return state.at("camera_pose", frame).apply(median * rays)


def seen_from_first(registered: Sequence[Registration]) -> list[Registration]:
    """Return placements whose world is the first frame's camera, in that frame's unit."""
    first = registered[0]
    to_first = first.world_from_camera.inverse()
    moved = [to_first @ p.world_from_camera for p in registered]
    return [
        replace(
            p, world_from_camera=RigidTransform(m.R, m.t / first.scale), scale=p.scale / first.scale
        )
        for p, m in zip(registered, moved, strict=True)
    ]


def at_identity(frames: int) -> list[Registration]:
    """Return the placement of all cameras at the same place."""
    here = RigidTransform.identity()
    return [Registration(here, 1.0, 0.0, 1.0, True, "") for _ in range(frames)]
