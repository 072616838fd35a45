"""Prior between one projector pose for all frames and an independent one for each: a random walk.

From frame to frame the projector moves by M = P_(k+1) P_k^-1, in its own axes: translation along z
is insertion, across it lateral; rotation about z is roll, of z tilt.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...geometry.transforms import RigidTransform
from ...records.rig import Rig
from ..unknowns.plan import Plan
from ..unknowns.state import State
from .objective import GlobalTerm

_STEP = 1e-6
"""Of the central differences, radians and baselines."""


def drift_prior(rig: Rig, plan: Plan) -> GlobalTerm | None:
    """Return the prior that the rig asks for, or None.

    Raises:
        InputError: spreads in mm without a known baseline.
    """
    drift = rig.drift
    if drift is None or plan.frames < 2:
        return None
    lengths = [drift.lateral_mm, drift.lateral_mm, drift.insertion_mm]
    baseline = rig.scale.baseline
    if baseline is None and any(s is not None for s in lengths):
        raise InputError(
            "spreads in mm need the unit of length, which is not known", "drift",
            "give scale.baseline or spreads in degrees only",
        )  # fmt: skip
    angles = [drift.tilt_deg, drift.tilt_deg, drift.roll_deg]
    spread = np.array(
        [np.inf if s is None else np.radians(s) for s in angles]
        + [np.inf if s is None or baseline is None else s / baseline for s in lengths]
    )
    return lambda state: _random_walk(plan, state, spread)


def _random_walk(
    plan: Plan, state: State, spread: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return Hessian (G, G), gradient (G,) and value of half the sum of squared whitened steps."""
    hessian = np.zeros((plan.columns, plan.columns))
    gradient, value = np.zeros(plan.columns), 0.0
    poses = state.projector_from_camera
    for k in range(plan.frames - 1):
        r = step_between(poses[k], poses[k + 1]) / spread
        J = np.zeros((6, plan.columns))
        for frame, moves_first in ((k, True), (k + 1, False)):
            slot = plan.slot("projector_pose", frame)
            assert slot is not None  # drift asks for a pose per frame
            J[:, slot] = _derivative(poses[k], poses[k + 1], moves_first) @ plan.chart(
                state, "projector_pose", frame
            )
        J /= spread[:, None]
        hessian += J.T @ J
        gradient += J.T @ r
        value += float(r @ r) / 2
    return hessian, gradient, value


def step_between(first: RigidTransform, second: RigidTransform) -> NDArray[np.float64]:
    """Return (rotation vector, translation) of second first^-1, in the projector's axes."""
    moved = second @ first.inverse()
    return np.concatenate([Rotation.from_matrix(moved.R).as_rotvec(), moved.t])


def _derivative(
    first: RigidTransform, second: RigidTransform, moves_first: bool
) -> NDArray[np.float64]:
    """Return (6, 6) derivatives of the step with respect to a perturbation of one pose."""
    columns = []
    for e in np.eye(6) * _STEP:
        pair = [
            step_between(first.perturbed(s), second)
            if moves_first
            else step_between(first, second.perturbed(s))
            for s in (e, -e)
        ]
        columns.append((pair[0] - pair[1]) / (2 * _STEP))
    return np.array(columns).T
