"""The problem of several frames that share one surface."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...start.registration import Registration
from ..cost.problem import Observations, Problem, curvature_prior, make_problem, prior_weight
from ..optimise.optimum import Optimum
from ..optimise.polish import smooth_surfaces
from ..optimise.rendered import USED_WEIGHT, render_frames
from ..options import Options
from ..unknowns.lattice import lattice_over
from ..unknowns.plan import Plan
from ..unknowns.state import INTRINSICS, State
from .initial import initial_rho

MARGIN = 3
"""Cells added around what the frames see: small steps of the cameras then stay on the surface."""


FINEST = 0.5
"""Least spacing of the common surface relative to that of the first frame alone: half of it
quadruples the vertices."""


@dataclass(frozen=True, eq=False)
class FrameStart:
    """What is kept of a frame solved alone, in units of its own baseline."""

    name: str
    observations: Observations
    cell: float
    """Spacing of its surface's lattice, radians."""
    points: NDArray[np.float64]
    """(V, 3) vertices of its surface in its camera's frame."""
    projector_from_camera: RigidTransform
    intrinsics: NDArray[np.float64]
    """(9,) as in :data:`INTRINSICS`."""
    squared: NDArray[np.float64]
    """(N,) squared residuals, NaN where missed."""
    used: NDArray[np.bool_]
    """(N,) correspondences that the robust loss kept."""
    information: NDArray[np.float64]
    """(G, G) about its own global unknowns, noise variances taken out."""
    range: NDArray[np.float64] | None
    """(H, W) range image of the surface as it is reported, if frames are registered by it."""
    notes: list[str]
    """From its start: what the user should know."""


def frame_start(
    optimum: Optimum, camera: CameraModel, options: Options, notes: list[str]
) -> FrameStart:
    """Keep of the optimum of one frame alone what the joint solution needs.

    The rest, most of all the scene for the ray tracer, is as large as many input maps.
    """
    problem, state = optimum.objective.problem, optimum.state
    lattice = problem.surfaces[0].lattice
    registered = options.cameras == "registration"
    return FrameStart(
        name=problem.frames[0].name,
        observations=problem.frames[0],
        cell=lattice.cell,
        points=lattice.vertices(state.rho[0]),
        projector_from_camera=state.projector_from_camera[0],
        intrinsics=state.intrinsics[0],
        squared=optimum.evaluation.squared(0),
        used=optimum.weights[0] > USED_WEIGHT,
        information=optimum.normal_equations().reduce().S / optimum.objective.sigma**2,
        range=render_frames(smooth_surfaces(optimum, options), camera)[0].range
        if registered
        else None,
        notes=notes,
    )


def joint_problem(
    starts: list[FrameStart],
    placed: list[Registration],
    plan: Plan,
    law: str,
) -> tuple[Problem, State]:
    """Build the joint problem of frames that were registered; the first one is the world.

    Args:
        starts: the frames solved alone.
        placed: where each is, in units of the first one's baseline.
        plan: sharing of the unknowns.
        law: projector law.
    """
    points = np.concatenate(
        [p.world_from_camera.apply(p.scale * s.points) for s, p in zip(starts, placed, strict=True)]
    )
    ranges = np.linalg.norm(points, axis=1)
    directions = points / ranges[:, None]
    lattice = lattice_over(directions, _cell(starts, placed), MARGIN)
    state = State(
        [initial_rho(lattice, directions, ranges)],
        [p.world_from_camera for p in placed],
        _projector_poses(starts, placed, plan),
        _intrinsics(starts, plan),
    )
    density = sum(s.observations.count for s in starts) / lattice.size
    focal = np.exp(state.intrinsics[0][INTRINSICS["focal"]][0])
    disparity = float(focal * np.linalg.norm(state.projector_from_camera[0].t))
    prior = curvature_prior(lattice, prior_weight(density), disparity)
    return make_problem([s.observations for s in starts], [lattice], [prior], plan, law), state


def _cell(starts: list[FrameStart], placed: list[Registration]) -> float:
    """Return the lattice spacing, radians, that keeps the detail of the frame that is nearest.

    What a cell of that frame spans is seen under a smaller angle from the first camera.
    """
    ratios = [1.0]
    for start, place in zip(starts, placed, strict=True):
        near = place.scale * start.points
        far = place.world_from_camera.apply(near)
        ratios.append(float(np.median(np.linalg.norm(near, axis=1) / np.linalg.norm(far, axis=1))))
    return starts[0].cell * max(min(ratios), FINEST)


def extended(optimum: Optimum) -> tuple[Problem, State] | None:
    """Return the problem with a surface grown to where cameras have moved, or None if it fits.

    Rays that miss the surface are taken to end at their frame's median range.
    """
    old, state = optimum.objective.problem, optimum.state
    missing = [_missed_points(old, optimum, k) for k in range(old.plan.frames)]
    if sum(len(m) for m in missing) < MISSED_SHARE * old.observations:
        return None
    lattice = old.surfaces[0].lattice
    points = np.concatenate([lattice.vertices(state.rho[0]), *missing])
    directions = points / np.linalg.norm(points, axis=1, keepdims=True)
    grown = lattice_over(directions, lattice.cell, 1)
    at = grown.nearest(lattice.directions)
    rho, seen = np.zeros(grown.size), np.zeros(grown.size, bool)
    rho[at], seen[at] = state.rho[0], True
    state = state.with_(rho=[grown.fill(seen, rho)])
    weight, disparity = old.surfaces[0].prior.weight, old.surfaces[0].prior.disparity
    prior = curvature_prior(grown, weight, disparity)
    return make_problem(old.frames, [grown], [prior], old.plan, old.law), state


MISSED_SHARE = 0.01
"""Share of rays that miss the surface from which on it is grown."""


def _missed_points(problem: Problem, optimum: Optimum, frame: int) -> NDArray[np.float64]:
    hit = optimum.evaluation.hits[frame]
    if hit.all():
        return np.zeros((0, 3))
    state = optimum.state
    _, distance, _, _ = problem.renderers[frame].render(state, frame, 0)
    median = float(np.median(distance[hit])) if hit.any() else 1 / float(np.median(state.rho[0]))
    return state.world_from_camera[frame].apply(median * problem.frames[frame].rays[~hit])


def _projector_poses(
    starts: list[FrameStart], placed: list[Registration], plan: Plan
) -> list[RigidTransform]:
    own = [s.projector_from_camera for s in starts]
    poses = [RigidTransform(pose.R, pose.t * p.scale) for pose, p in zip(own, placed, strict=True)]
    if plan.blocks["projector_pose"] == "per_frame":
        return poses
    mean = np.mean([pose.t / np.linalg.norm(pose.t) for pose in own], axis=0)
    R = Rotation.from_matrix([pose.R for pose in own]).mean().as_matrix()
    return [RigidTransform(R, mean / np.linalg.norm(mean))] * len(poses)


def _intrinsics(starts: list[FrameStart], plan: Plan) -> list[NDArray[np.float64]]:
    own = np.array([s.intrinsics for s in starts])
    for name, place in INTRINSICS.items():
        if plan.blocks[name] != "per_frame":
            own[:, place] = np.median(own[:, place], axis=0)
    return list(own)


def seen_from_first(placed: list[Registration]) -> list[Registration]:
    """Return placements whose world is the first frame's camera, in that frame's unit."""
    first = placed[0]
    to_first = first.world_from_camera.inverse()
    moved = [to_first @ p.world_from_camera for p in placed]
    return [
        replace(
            p, world_from_camera=RigidTransform(m.R, m.t / first.scale), scale=p.scale / first.scale
        )
        for p, m in zip(placed, moved, strict=True)
    ]


def at_identity(frames: int) -> list[Registration]:
    """Return the placement of all cameras at the same place."""
    here = RigidTransform.identity()
    return [Registration(here, 1.0, 0.0, 1.0, True, "") for _ in range(frames)]


def single_plan(plan: Plan) -> Plan:
    """Return the plan of one frame solved alone."""
    blocks = {
        name: "fixed" if name == "camera_pose" or mode == "fixed" else "shared"
        for name, mode in plan.blocks.items()
    }
    return replace(plan, frames=1, surface="shared", blocks=blocks, _slots={})
