"""Applying a step of the unknowns to a state."""

import numpy as np
from numpy.typing import NDArray

from ...geometry.transforms import RigidTransform
from .plan import Plan
from .state import INTRINSICS, State

_FARTHEST = 20.0
"""Farthest range of a vertex, in medians: an outlier may push it there but not behind us."""


def apply_step(
    plan: Plan, state: State, surfaces: list[NDArray[np.float64]], step: NDArray[np.float64]
) -> State:
    """Return the state after steps of the inverse ranges (V,) and of the global unknowns (G,)."""
    rho = [
        np.maximum(old + change, np.median(old) / _FARTHEST)
        for old, change in zip(state.rho, surfaces, strict=True)
    ]
    frames = range(plan.frames)
    return State(
        rho,
        [_moved(plan, state, "camera_pose", k, state.world_from_camera[k], step) for k in frames],
        [
            _moved(plan, state, "projector_pose", k, state.projector_from_camera[k], step)
            for k in frames
        ],
        [_intrinsics(plan, state, k, step) for k in frames],
    )


def _moved(
    plan: Plan, state: State, name: str, frame: int, pose: RigidTransform, step: NDArray[np.float64]
) -> RigidTransform:
    local = plan.step_local(state, name, frame, step)
    if local is None:
        return pose
    moved = pose.perturbed(local)
    if plan.holds_length(name, plan.owner(name, frame)):
        moved = RigidTransform(
            moved.R, moved.t * (np.linalg.norm(pose.t) / np.linalg.norm(moved.t))
        )
    return moved


def _intrinsics(
    plan: Plan, state: State, frame: int, step: NDArray[np.float64]
) -> NDArray[np.float64]:
    vector = state.intrinsics[frame].copy()
    for name, place in INTRINSICS.items():
        local = plan.step_local(state, name, frame, step)
        if local is not None:
            vector[place.start : place.start + len(local)] += local
    return vector
