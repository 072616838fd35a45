"""Levenberg-Marquardt over rotation, translation direction and focal length on robust residuals."""

from dataclasses import dataclass

import numpy as np

from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import (
    RigidTransform,
    rotation_from_vector,
    tangent_basis,
)
from mitsuba_endo.robust import robust_std

from .correspondences import Correspondences
from .epipolar_residual import Bearings, Residuals, bearings, jacobian, residuals
from .vectors import Vectors

_OUT_OF_RANGE_PX = 1e3  # residual of a coordinate that the law cannot produce at the tried focal
_STEP_TOLERANCE = 1e-7  # radians, and relative focal length
_COST_TOLERANCE = 1e-7
"""Relative fall of the cost in a step, and a tenth of the predicted one, at which a descent ends.
Chosen."""
_HOPELESS_DAMPING = 1e8
"""Damping, relative to the Hessian's diagonal, under which steps are too short to matter."""


@dataclass(frozen=True)
class EpipolarLoss:
    """A robust loss of residuals in pattern pixels; both have curvature 1 at zero."""

    redescending: bool
    """False: Cauchy, c^2/2 log(1 + r^2/c^2). True: Geman-McClure, c^2/2 r^2 / (c^2 + r^2)."""
    scale: float
    """c, pattern pixels."""

    def cost(self, r: Vectors) -> float:
        """Return the mean loss, pattern pixels squared."""
        return float(self.values(r).mean())

    def values(self, r: Vectors) -> Vectors:
        """Return the loss of every residual, pattern pixels squared."""
        s = (r / self.scale) ** 2
        return 0.5 * self.scale**2 * (s / (1 + s) if self.redescending else np.log1p(s))

    def weight(self, r: Vectors) -> Vectors:
        """Return rho'(r) / r, the weight of iteratively reweighted least squares."""
        w = 1 / (1 + (r / self.scale) ** 2)
        return w * w if self.redescending else w


@dataclass(frozen=True, eq=False)
class EpipolarState:
    """A calibration with its bearings and residuals."""

    pose: RigidTransform
    """projector_from_camera, |t| = 1."""
    projector: ProjectorModel
    bearings: Bearings
    at: Residuals

    @property
    def r(self) -> Vectors:
        """(N,) residuals, pattern pixels; coordinates that the law cannot produce count as far."""
        return np.where(np.isfinite(self.at.r), self.at.r, _OUT_OF_RANGE_PX)


def evaluate(
    pose: RigidTransform,
    projector: ProjectorModel,
    data: Correspondences,
    pattern_bearings: Bearings | None = None,
) -> EpipolarState:
    """Return the state at a calibration; ``pattern_bearings`` where they are known already."""
    if pattern_bearings is None:
        pattern_bearings = bearings(projector, data.q)
    return EpipolarState(
        pose, projector, pattern_bearings, residuals(pose, data.rays, pattern_bearings)
    )


def minimise(
    state: EpipolarState,
    data: Correspondences,
    loss: EpipolarLoss,
    *,
    refine_focal: bool,
    focal_bounds: tuple[float, float] = (0.0, np.inf),
    iterations: int = 20,
) -> EpipolarState:
    """Return the state at the minimum of the mean loss near ``state``.

    The damping follows the ratio of gained to predicted cost (Nielsen 1999), which in the curved
    valley of focal length against pose needs half the steps of a fixed factor. Steps that leave
    ``focal_bounds`` are refused, so that a collapsing focal length stops there.
    """
    damping, growth, cost = 1e-3, 2.0, loss.cost(state.r)
    hessian, gradient = _normal_equations(state, data, loss, refine_focal)
    for _ in range(iterations):
        step = _damped_step(hessian, gradient, damping)
        trial = _moved(state, step, data)
        trial_cost = loss.cost(trial.r)
        inside = focal_bounds[0] <= trial.projector.focal <= focal_bounds[1]
        small = np.abs(step).max() < _STEP_TOLERANCE
        if inside and trial_cost <= cost:
            gain = cost - trial_cost
            predicted = -(gradient @ step + 0.5 * step @ hessian @ step) / len(data)
            small |= gain < _COST_TOLERANCE * cost and predicted < 10 * _COST_TOLERANCE * cost
            state, cost = trial, trial_cost
            ratio = min(gain / max(float(predicted), 1e-300), 1e3)
            damping *= max(1 / 3, 1 - (2 * ratio - 1) ** 3)
            growth = 2.0
            if small:
                break
            hessian, gradient = _normal_equations(state, data, loss, refine_focal)
        elif small or damping > _HOPELESS_DAMPING:
            break
        else:
            damping, growth = damping * growth, 2 * growth
    return state


def focal_deviation(state: EpipolarState, data: Correspondences, loss: EpipolarLoss) -> float:
    """Return the formal standard deviation of log focal: (J^T W J)^-1 times the noise variance."""
    hessian, _ = _normal_equations(state, data, loss, True)
    noise = robust_std(state.r)
    # Scaling to a unit diagonal keeps the inverse meaningful for a nearly singular matrix.
    d = 1 / np.sqrt(np.diag(hessian) + 1e-300)
    scaled = np.linalg.pinv(hessian * np.outer(d, d), rcond=1e-15, hermitian=True)
    return noise * d[5] * float(np.sqrt(max(scaled[5, 5], 0.0)))


def _normal_equations(
    state: EpipolarState, data: Correspondences, loss: EpipolarLoss, refine_focal: bool
) -> tuple[Vectors, Vectors]:
    r = state.r
    J = jacobian(
        state.pose, state.projector, data.rays, data.q, state.bearings, state.at, refine_focal
    )
    J = np.where(np.isfinite(J).all(0), J, 0.0)
    weighted = J * loss.weight(r)
    return weighted @ J.T, weighted @ r


def _damped_step(hessian: Vectors, gradient: Vectors, damping: float) -> Vectors:
    diagonal = np.diag(hessian)
    # The floor lets a step exist where the data say nothing about an unknown.
    damped = hessian + np.diag(damping * diagonal + 1e-12 * diagonal.max() + 1e-300)
    return -np.linalg.solve(damped, gradient).astype(np.float64, copy=False)


def _moved(state: EpipolarState, step: Vectors, data: Correspondences) -> EpipolarState:
    t = state.pose.t + tangent_basis(state.pose.t) @ step[3:5]
    pose = RigidTransform(rotation_from_vector(step[:3]) @ state.pose.R, t / np.linalg.norm(t))
    if step.size == 5:
        return evaluate(pose, state.projector, data, state.bearings)
    # A longer step than this is a singular matrix speaking, not the data.
    focal = state.projector.focal * float(np.exp(np.clip(step[5], -0.7, 0.7)))
    projector = state.projector.with_(focal=focal)
    return evaluate(pose, projector, data, bearings(projector, data.q, state.bearings))
