"""A frame's correspondences as tracking uses them: thinned, cleaned, sampled."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..initialisation.epipolar_residual import Bearings, bearings
from ..initialisation.outlier_rejection import clean_map
from ..records.correspondence import CorrespondenceMap

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

COLUMNS = 400
"""Images wider than this are thinned: noise of a decoder is alike over several pixels, and time
and memory go with their number."""
SAMPLES = 6000
"""Correspondences by which a frame is placed."""

BLOCKS = (4, 6)
"""Rows and columns of blocks of the image, from one to another of which errors are independent."""


@dataclass(frozen=True, eq=False)
class ThinnedMap:
    """One frame, as fine as it is fused."""

    name: str
    camera: CameraModel
    q: Floats
    """(H, W, 2) pattern pixels, NaN = missing."""
    usable: Bools
    """(H, W) neither lone outliers nor small patches."""

    def sample(self, projector: ProjectorModel, count: int = SAMPLES) -> "PixelSample":
        """Return about ``count`` usable correspondences, spread evenly."""
        at = np.flatnonzero(self.usable)
        if len(at) > count:
            at = at[np.linspace(0, len(at) - 1, count).astype(int)]
        return self.correspondences(projector, at)

    def correspondences(self, projector: ProjectorModel, at: NDArray[np.int_]) -> "PixelSample":
        """Return the correspondences of the pixels with flat indices ``at`` (N,)."""
        q = self.q.reshape(-1, 2)[at].T
        rays = np.ascontiguousarray(self.camera.grid_rays.reshape(-1, 3)[at].T)
        height, width = self.usable.shape
        row, column = (BLOCKS[0] * (at // width)) // height, (BLOCKS[1] * (at % width)) // width
        return PixelSample(rays, q, bearings(projector, q), BLOCKS[1] * row + column)


@dataclass(frozen=True, eq=False)
class PixelSample:
    """N correspondences, components first."""

    rays: Floats
    """(3, N) unit, camera's frame."""
    q: Floats
    """(2, N) pattern pixels."""
    bearings: Bearings
    """Of q, in the projector's frame."""
    block: NDArray[np.int_]
    """(N,) which of the image's :data:`BLOCKS` each lies in."""

    def __len__(self) -> int:
        return self.q.shape[1]


def thinning(camera: CameraModel) -> int:
    """Return the step, pixels, at which images of a camera are used."""
    return max(1, -(-camera.width // COLUMNS))


def thinned(camera: CameraModel, step: int) -> CameraModel:
    """Return the camera whose pixels are every ``step``-th of another's, from the first one."""
    K = np.array(camera.K, float)
    K[:2] /= step
    return replace(camera, width=-(-camera.width // step), height=-(-camera.height // step), K=K)


def view_of(map_: CorrespondenceMap, camera: CameraModel, step: int) -> ThinnedMap:
    """Thin and clean a map.

    Args:
        map_: of a frame.
        camera: :func:`thinned`, so that its rays are computed once for all frames.
        step: of the thinning.
    """
    q = map_.q[::step, ::step].astype(np.float64)
    lit = np.asarray(np.isfinite(camera.grid_rays).all(-1))
    q = np.where(lit[..., None], q, np.nan)
    return ThinnedMap(map_.name, camera, q, clean_map(q))
