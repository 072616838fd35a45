"""The Cramer-Rao bound of one frame's calibration when every pixel has a free range.

A correspondence has two coordinates and one range of its own; what remains for the calibration is
the component across the curve on which the point moves with its range, e = n . (q - q(X)), with n
perpendicular to dq/d range. So the information is the sum of J_e^T J_e / sigma^2 over the pixels,
J_e = n^T dq / d(focal, rotation, translation direction), here by central differences. A solver
that uses smoothness of the surface may do better.
"""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.transforms import RigidTransform, tangent_basis

from .capture import Truth

Floats = NDArray[np.float64]
_STEP = 1e-5


def calibration_bound(truth: Truth, points: Floats, sigma: float) -> dict[str, float]:
    """Return least standard deviations: focal (%), rotation (deg), translation direction (deg).

    Args:
        truth: of which the first frame counts.
        points: (N, 3) seen and lit, in the first camera's frame, mm.
        sigma: noise of one coordinate, pattern pixels.
    """
    pose = truth.projector_from_camera[0]
    basis = tangent_basis(pose.t) * truth.baseline

    def project(step: Floats, stretch: float = 1.0) -> Floats:
        moved = RigidTransform(pose.R, pose.t + basis @ step[4:6]).perturbed(
            np.concatenate([step[1:4], np.zeros(3)])
        )
        projector = truth.projector.with_(focal=truth.projector.focal * np.exp(step[0]))
        return projector.project(moved.apply(stretch * points))

    zero = np.zeros(6)
    along = project(zero, 1 + _STEP) - project(zero, 1 - _STEP)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    rows = [
        np.sum(across * (project(step) - project(-step)), axis=1) / (2 * _STEP)
        for step in _STEP * np.eye(6)
    ]
    J = np.array(rows).T / sigma
    variance = np.diag(np.linalg.inv(J.T @ J))
    return {
        "focal": 100 * float(np.sqrt(variance[0])),
        "rotation": float(np.degrees(np.sqrt(variance[1:4].sum()))),
        "direction": float(np.degrees(np.sqrt(variance[4:].sum()))),
    }
