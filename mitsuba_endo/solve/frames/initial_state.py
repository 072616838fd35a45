"""From a start to the first state of the optimisation."""

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...initialisation.triangulate import smooth_depth
from ...records.correspondence import CorrespondenceMap
from ..costs.coordinate_residual import Observations
from ..surfaces.inverse_range_lattice import Lattice

PER_VERTEX = 9
"""Observations per surface vertex: cells of three pixels where every pixel is decoded."""
MAX_VERTICES = 12_000
"""Of the part that one frame sees; finer surfaces cost time and hardly any detail."""
THINNEST = 1e-3
"""Variance along one axis, of the mean of both, below which a coordinate is not believed."""
_BLOCK = 8
"""Side, pixels, of the blocks in which the area covered by observations is counted."""


def observations(
    map_: CorrespondenceMap, used: NDArray[np.bool_], camera: CameraModel
) -> Observations:
    """Collect the correspondences ``used`` (H, W) of a map."""
    y, x = np.nonzero(used)
    pixels = np.stack([x, y], -1, dtype=np.int32)
    q = map_.q[used].T.astype(np.float64)
    return Observations(map_.name, camera, q, pixels, whitening(map_, used))


def whitening(map_: CorrespondenceMap, used: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Return W of the correspondences ``used``, see :attr:`Observations.whitening`.

    The weight says how well a coordinate is known altogether, the covariance how its error lies:
    with the mean of its two variances one, W = sqrt(weight) L^-1, covariance = L L^T.
    """
    if map_.covariance is None:
        return None if map_.weight is None else np.sqrt(map_.weight[used].astype(np.float64))
    xx, xy, yy = map_.covariance[used].T.astype(np.float64)
    mean = (xx + yy) / 2
    finite = np.isfinite(mean + xy)
    xx, xy, yy = (
        np.where(finite, part / mean, alike) for part, alike in ((xx, 1.0), (xy, 0.0), (yy, 1.0))
    )
    root = np.sqrt(np.maximum(xx, THINNEST))
    lower = np.sqrt(np.maximum(yy - (xy / root) ** 2, THINNEST))
    # Inverse of [[root, 0], [xy / root, lower]].
    W = np.array([[1 / root, np.zeros_like(root)], [-xy / (root**2 * lower), 1 / lower]])
    return W if map_.weight is None else W * np.sqrt(map_.weight[used].astype(np.float64))


def cell_size(frame: Observations, camera: CameraModel, cell_px: float | None) -> float:
    """Return the lattice spacing, radians, for a frame's density of observations.

    Args:
        frame: the observations.
        camera: their camera.
        cell_px: spacing in pixels, or None to choose it.
    """
    if cell_px is None:
        x, y = frame.pixels.T // _BLOCK
        covered = np.zeros((y.max() + 1, x.max() + 1), bool)
        covered[y, x] = True
        area = float(covered.sum() * _BLOCK**2)
        vertices = min(frame.count / PER_VERTEX, MAX_VERTICES)
        cell_px = float(np.sqrt(area / vertices))
    return cell_px * pixel_angle(camera)


def pixel_angle(camera: CameraModel) -> float:
    """Return the angle between the rays of neighbouring pixels, the image's median, radians."""
    grid = camera.pixel_grid()[::8, ::8]
    a, b = camera.rays(grid), camera.rays(grid + np.array([1.0, 0.0]))
    chord = np.linalg.norm(a - b, axis=-1)
    return float(np.nanmedian(chord))


def initial_rho(
    lattice: Lattice, directions: NDArray[np.float64], ranges: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return inverse ranges (V,) as the median of the samples nearest to every vertex.

    Args:
        lattice: the surface.
        directions: (N, 3) unit directions of the samples.
        ranges: (N,) positive ranges.
    """
    at = lattice.nearest(directions)
    keep = (at >= 0) & np.isfinite(ranges) & (ranges > 0)
    at, value = at[keep], 1 / ranges[keep]
    order = np.lexsort((value, at))
    at, value = at[order], value[order]
    vertex, first, count = np.unique(at, return_index=True, return_counts=True)
    rho = np.zeros(lattice.size)
    rho[vertex] = value[first + count // 2]
    covered = np.zeros(lattice.size, bool)
    covered[vertex] = True
    return lattice.fill(covered, rho)


def smooth_samples(
    depth: NDArray[np.float64], frame: Observations
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return directions (N, 3) and median-filtered ranges (N,) of a start's depth image (H, W)."""
    smooth = smooth_depth(depth)[frame.pixels[:, 1], frame.pixels[:, 0]]
    return frame.rays, smooth
