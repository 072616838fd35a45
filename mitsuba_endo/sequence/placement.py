"""Placing one frame: camera and projector by Gauss-Newton against the map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..fusion import Volume
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..robust import geman_mcclure_weight, robust_std
from ..solve.costs.drift import step_between
from .linearise import AgainstMap, Poses, Triangulated, against_map, triangulate
from .view import PixelSample

Floats = NDArray[np.float64]

STEPS = 30
"""At most; six are the rule, and more where motion was not as predicted."""
SETTLED = 1e-4
"""Largest component of a step, radians or relative to the range, that ends the iteration: a
twentieth of what noise moves a pose by."""
WIDEST = 8.0
"""The loss begins so many times wider and is halved from step to step: predictions are off by
more than noise."""
MAP_NOISE = 0.1
"""Standard deviation of the map where it is known, voxels."""
FAR = 3.0
"""Standard deviations beyond which a correspondence does not agree."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the projector's pose before the frame."""

    mean: RigidTransform
    """projector_from_camera."""
    information: Floats
    """(6, 6) of the step from the mean: rotation vector and translation in the projector's axes."""

    def pull(self, poses: Poses) -> Floats:
        """Return how far (6,) the projector is from the mean."""
        return step_between(self.mean, poses.projector_from_camera)


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a frame was put, and how well it fits there."""

    poses: Poses
    triangulated: Triangulated
    """The sample's points, there."""
    noise: float
    """Of a coordinate, across its epipolar line, pattern pixels: robust standard deviation."""
    on_lines: float
    """Share of the correspondences within :data:`FAR` standard deviations of their lines."""
    overlap: float
    """Share of the correspondences where the map is known."""
    agreement: float
    """Share of these within :data:`FAR` standard deviations of the map."""
    misfit: float
    """Robust standard deviation of the distances to the map over that expected of noise."""
    settled: bool
    """Whether the last step was below noise."""
    covariance: Floats
    """(12, 12) of :meth:`Poses.moved`'s step, as if errors of pixels were independent."""
    clustered: Floats
    """(12, 12) of the same from how blocks of the image disagree; of low rank, for means over
    frames."""


def place(
    sample: PixelSample,
    start: Poses,
    projector: ProjectorModel,
    volume: Volume,
    prior: Prior,
    noise: float,
) -> Placement:
    """Move camera and projector from a start to where correspondences and map agree.

    Args:
        sample: of the frame.
        start: poses to begin with, the map within reach.
        projector: with its focal length.
        volume: the map. Where it knows nothing, epipolar lines alone place the projector, and the
            camera stays.
        prior: on the projector.
        noise: of a coordinate, pattern pixels, as far as it is known; estimated anew.
    """
    poses, widened, settled = start, WIDEST, False
    triangulated = triangulate(sample, projector, poses.projector_from_camera)
    for _ in range(STEPS):
        residuals = against_map(sample, triangulated, poses.world_from_camera, volume)
        noise = noise_of(triangulated, noise)
        A, b = _equations(triangulated, residuals, noise, volume.voxel, widened)
        A[:6, :6] += prior.information
        b[:6] -= prior.information @ prior.pull(poses)
        step = np.linalg.solve(A, b).astype(np.float64)
        poses = poses.moved(step)
        triangulated = triangulate(sample, projector, poses.projector_from_camera)
        settled = widened == 1 and _relative(step, triangulated) < SETTLED
        if settled:
            break
        widened = max(1.0, widened / 2)
    residuals = against_map(sample, triangulated, poses.world_from_camera, volume)
    curvature = _curvature(triangulated, residuals, noise, volume.voxel)
    curvature[:6, :6] += prior.information
    covariance = np.linalg.inv(curvature).astype(np.float64)
    scatter = _scatter(sample.block, triangulated, residuals, noise, volume.voxel)
    clustered = covariance @ scatter @ covariance
    return _judged(
        triangulated, residuals, poses, noise, volume.voxel, settled, (covariance, clustered)
    )


def _relative(step: Floats, triangulated: Triangulated) -> float:
    """Return the largest component of a step, radians or parts of the typical range."""
    size = (
        float(np.median(triangulated.range[triangulated.good])) if triangulated.good.any() else 1.0
    )
    return float(np.abs(step / np.tile([1, 1, 1, size, size, size], 2)).max())


def _judged(
    triangulated: Triangulated, residuals: AgainstMap, poses: Poses, noise: float, voxel: float,
    settled: bool, covariances: tuple[Floats, Floats],
) -> Placement:  # fmt: skip
    off = np.abs(residuals.distance / deviation(triangulated, residuals, noise, voxel))[
        residuals.observed
    ]
    near = triangulated.good & (np.abs(triangulated.across) < FAR * noise)
    return Placement(
        poses, triangulated, noise, float(near.mean()), float(residuals.observed.mean()),
        float((off < FAR).mean()) if len(off) else 0.0,
        robust_std(off) if len(off) else np.inf, settled, *covariances,
    )  # fmt: skip


def noise_of(triangulated: Triangulated, otherwise: float) -> float:
    """Return the robust standard deviation of the epipolar residuals, pattern pixels."""
    if not triangulated.good.any():
        return otherwise
    return max(robust_std(triangulated.across[triangulated.good]), 1e-3)


def deviation(
    triangulated: Triangulated, residuals: AgainstMap, noise: float, voxel: float
) -> Floats:
    """Return the standard deviations (N,) of distances to the map."""
    along = np.abs(residuals.cosine) * noise / triangulated.pixels_per_length
    return np.hypot(along, MAP_NOISE * voxel)


def _equations(
    triangulated: Triangulated, residuals: AgainstMap, noise: float, voxel: float, widened: float
) -> tuple[Floats, Floats]:
    """Return A (12, 12) and b (12,) of a step under Geman and McClure's loss."""
    (across, on_line, r), (along, on_map, d) = _rows(triangulated, residuals, noise, voxel, widened)
    A, b = np.zeros((12, 12)), np.zeros(12)
    A[:6, :6] = (across * on_line) @ across.T
    b[:6] = across @ (on_line * r)
    A += (along * on_map) @ along.T
    b += along @ (on_map * d)
    return _held(A), b


def _held(A: Floats) -> Floats:
    """Hold the camera where no map is known; nothing else moves by a hundredth of its noise."""
    return A + 1e-9 * np.trace(A) * np.eye(12)


def _curvature(
    triangulated: Triangulated, residuals: AgainstMap, noise: float, voxel: float
) -> Floats:
    """Return the cost's second derivatives (12, 12), which say how far noise moves the minimum.

    The weights that make the steps overstate it. With r the residual over c = :data:`FAR`, the loss
    of Geman and McClure has the influence r / (1 + r^2)^2 and the curvature
    (1 - 3 r^2) / (1 + r^2)^3,
    of which the mean over the residuals is taken.
    """
    (across, on_line, r), (along, _, d) = _rows(triangulated, residuals, noise, voxel, 1.0)
    observed = residuals.observed & triangulated.good
    A = np.zeros((12, 12))
    A[:6, :6] = mean_curvature(r[triangulated.good]) * (across * triangulated.good) @ across.T
    A += mean_curvature(d[observed]) * (along * (on_line * observed)) @ along.T
    return _held(A)


def mean_curvature(residual: Floats) -> float:
    """Return the mean second derivative of the loss, at least a tenth of least squares'."""
    if not len(residual):
        return 1.0
    squared = (residual / FAR) ** 2
    return max(float(np.mean((1 - 3 * squared) / (1 + squared) ** 3)), 0.1)


def _rows(
    triangulated: Triangulated, residuals: AgainstMap, noise: float, voxel: float, widened: float
) -> tuple[tuple[Floats, Floats, Floats], tuple[Floats, Floats, Floats]]:
    """Return derivatives, weights and residuals, across the lines (6, N) and to the map (12, N)."""
    r = triangulated.across / noise
    on_line = np.where(triangulated.good, geman_mcclure_weight(r / FAR), 0.0)
    std = deviation(triangulated, residuals, noise, voxel)
    d = -residuals.distance / std
    on_map = np.where(residuals.observed, on_line * geman_mcclure_weight(d / FAR / widened), 0.0)
    return (triangulated.by_pose[:6] / noise, on_line, r), (residuals.by_poses / std, on_map, d)


def _scatter(
    block: NDArray[np.int_],
    triangulated: Triangulated,
    residuals: AgainstMap,
    noise: float,
    voxel: float,
) -> Floats:
    """Return (12, 12) sum over blocks of g g^T, g being a block's share of b.

    Between two inverses of A it is the covariance of a step whatever errors the pixels of a block
    share (the sandwich of White and of Liang and Zeger, 1986, blocks as clusters).
    """
    (across, on_line, r), (along, on_map, d) = _rows(triangulated, residuals, noise, voxel, 1.0)
    scores = along * (on_map * d)
    scores[:6] += across * (on_line * r)
    count = int(block.max(initial=0)) + 1
    sums = np.stack([np.bincount(block, row, count) for row in scores])
    return sums @ sums.T * count / max(count - 1, 1)
