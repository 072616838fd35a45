"""The focal length that the epipolar lines of several frames agree on.

With the surface free, what is left of a correspondence is its distance from the epipolar line. So
each frame, with five unknowns of its projector's pose taken out, tells of the focal length alone;
what frames tell is added. Noise of different frames is independent, and averages out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform, tangent_basis
from ..robust import geman_mcclure_weight
from .linearise import Triangulated, orthonormal, triangulate
from .placement import FAR, noise_of
from .view import SAMPLES, ThinnedMap

Floats = NDArray[np.float64]

ROUNDS = 4
"""Gauss-Newton steps of a fit: it begins near, from the frame before. Chosen."""


@dataclass(frozen=True)
class FocalSum:
    """What frames have told so far of the log of the focal length, relative to one value."""

    information: float = 0.0
    pull: float = 0.0
    squares: float = 0.0
    """Sum over frames of (pull - information * estimate)^2, as if the estimate were zero."""
    cross: float = 0.0
    """Sum of pull * information, from which ``squares`` is moved to another estimate."""
    weights: float = 0.0
    """Sum of information^2."""
    frames: int = 0

    def plus(self, information: float, pull: float) -> "FocalSum":
        """Add a frame."""
        return FocalSum(
            self.information + information, self.pull + pull, self.squares + pull**2,
            self.cross + pull * information, self.weights + information**2, self.frames + 1,
        )  # fmt: skip

    @property
    def change(self) -> float:
        """Return the estimate: by how much the log should change."""
        return self.pull / self.information if self.information > 0 else 0.0

    @property
    def std(self) -> float:
        """Return its standard deviation from how frames disagree (a sandwich); NaN of few frames.

        Whatever errors the pixels of a frame share is in it; what all frames share is not.
        """
        if self.frames < 3 or self.information <= 0:
            return float("nan")
        x = self.change
        scatter = self.squares - 2 * x * self.cross + x**2 * self.weights
        scatter = max(scatter, 0.0) * self.frames / (self.frames - 1)
        return float(np.sqrt(scatter)) / self.information


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A focal length, and the projector's poses with it."""

    projector: ProjectorModel
    poses: list[RigidTransform]
    """projector_from_camera; the translations are as long as they were."""
    told: FocalSum
    """About the last value."""


def focal_of(
    views: Sequence[ThinnedMap], projector: ProjectorModel, start: RigidTransform, *, free: bool
) -> Calibrated:
    """Fit the projector's pose of each frame to its epipolar lines, and one focal length to all.

    Args:
        views: in order; the projector hardly moves from one to the next.
        projector: with a focal length that is nearly right.
        start: projector_from_camera of the first.
        free: whether the focal length is an unknown.
    """
    poses: list[RigidTransform] = []
    for view in views:
        poses.append(_on_lines(view, projector, poses[-1] if poses else start))
    told = FocalSum()
    for _ in range(ROUNDS if free else 0):
        parts = [_equations(v, projector, p) for v, p in zip(views, poses, strict=True)]
        told = FocalSum()
        for part in parts:
            told = told.plus(*part.focal)
        poses = [p.moved(pose, told.change) for p, pose in zip(parts, poses, strict=True)]
        projector = projector.with_(focal=float(projector.focal) * float(np.exp(told.change)))
    return Calibrated(projector, poses, told)


def told_of_focal(
    triangulated: Triangulated, pose: RigidTransform, noise: float
) -> tuple[float, float]:
    """Return the information and the pull of one frame on the log of the focal length."""
    return _linear(triangulated, pose, noise).focal


@dataclass(frozen=True, eq=False)
class _Equations:
    """Normal equations of one frame's pose (5) and the log of the focal length."""

    A: Floats
    b: Floats
    basis: Floats
    """(6, 5) directions of the pose that lines tell: not the length of the translation."""

    @property
    def focal(self) -> tuple[float, float]:
        gain = np.linalg.solve(self.A[:5, :5], self.A[:5, 5])
        return float(self.A[5, 5] - gain @ self.A[:5, 5]), float(self.b[5] - gain @ self.b[:5])

    def moved(self, pose: RigidTransform, focal: float) -> RigidTransform:
        """Return the pose after a step that goes with a change of the log of the focal length."""
        step = np.linalg.solve(self.A[:5, :5], self.b[:5] - focal * self.A[:5, 5])
        near = orthonormal(pose.perturbed(self.basis @ step))
        length = np.linalg.norm(pose.t)
        return RigidTransform(near.R, near.t * length / np.linalg.norm(near.t))


def pose_directions(pose: RigidTransform) -> Floats:
    """Return (6, 5) the steps of a pose that lines tell: all but the translation's length."""
    basis = np.zeros((6, 5))
    basis[:3, :3] = np.eye(3)
    basis[3:, 3:] = tangent_basis(pose.t)
    return basis


def _on_lines(view: ThinnedMap, projector: ProjectorModel, pose: RigidTransform) -> RigidTransform:
    for _ in range(ROUNDS):
        pose = _equations(view, projector, pose).moved(pose, 0.0)
    return pose


def _equations(view: ThinnedMap, projector: ProjectorModel, pose: RigidTransform) -> _Equations:
    triangulated = triangulate(view.sample(projector, SAMPLES), projector, pose)
    return _linear(triangulated, pose, noise_of(triangulated, 1.0))


def _linear(triangulated: Triangulated, pose: RigidTransform, noise: float) -> _Equations:
    basis = pose_directions(pose)
    r = triangulated.across / noise
    weight = np.where(triangulated.good, geman_mcclure_weight(r / FAR), 0.0)
    J = np.concatenate([basis.T @ triangulated.by_pose[:6], triangulated.by_pose[6:]]) / noise
    A = (J * weight) @ J.T
    A[np.arange(5), np.arange(5)] += 1e-9 * np.trace(A[:5, :5]) / 5
    return _Equations(A, J @ (weight * r), basis)
