"""Correspondences as flat arrays: a camera ray and the pattern coordinate seen along it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.records.consistency import MIN_CORRESPONDENCES

PROPOSE_POINTS, REFINE_POINTS = 500, 1500
"""Correspondences of a frame from which poses are proposed, and on which they are refined."""


@dataclass(frozen=True, eq=False)
class Correspondences:
    """N correspondences, components first so that arithmetic runs over contiguous memory."""

    pixel: NDArray[np.intp]
    """(N,) flat index into the (H, W) map."""
    rays: NDArray[np.float64]
    """(3, N) unit directions in the camera frame."""
    q: NDArray[np.float64]
    """(2, N) pattern pixels."""

    def __len__(self) -> int:
        return self.pixel.size

    def take(self, index: NDArray) -> "Correspondences":
        """Return the correspondences at ``index`` (integers or a mask)."""
        return Correspondences(self.pixel[index], self.rays[:, index], self.q[:, index])


def checked_map(q: NDArray[np.floating], camera: CameraModel) -> NDArray[np.float64]:
    """Return ``q`` as float64 after checking its shape (camera height, camera width, 2).

    Raises:
        InputError: for another shape.
    """
    q = np.asarray(q, np.float64)
    expected = (camera.height, camera.width, 2)
    if q.shape != expected:
        raise InputError(
            f"the correspondence map has shape {q.shape}, the camera needs {expected}",
            todo="use the map and the camera of the same image size",
        )
    return q


def gather(
    q: NDArray[np.float64], usable: NDArray[np.bool_], camera: CameraModel
) -> Correspondences:
    """Return the correspondences of the pixels in ``usable`` (H, W).

    Raises:
        InputError: when fewer than :data:`MIN_CORRESPONDENCES` are left.
    """
    pixel = np.flatnonzero(usable)
    if pixel.size < MIN_CORRESPONDENCES:
        raise InputError(
            f"{pixel.size} usable correspondences, at least {MIN_CORRESPONDENCES} are needed",
            todo="give a map in which more of the pattern was found",
        )
    rows, columns = np.divmod(pixel, camera.width)
    rays = np.stack(camera.direction_uv(columns.astype(np.float64), rows.astype(np.float64)))
    rays /= np.sqrt(np.einsum("in,in->n", rays, rays))
    finite = np.isfinite(rays).all(0)
    return Correspondences(
        pixel[finite], rays[:, finite], np.ascontiguousarray(q.reshape(-1, 2)[pixel[finite]].T)
    )


def spread_sample(
    data: Correspondences, count: int, width: int, rng: np.random.Generator
) -> Correspondences:
    """Return about ``count`` correspondences, one random one from each cell of a square grid.

    Cells make the sample uniform over the seen part of the image, so that a densely decoded patch
    does not outvote the rest.

    Args:
        width: width of the map, pixels.
    """
    if len(data) <= count:
        return data
    side = np.sqrt(len(data) / count)
    order = rng.permutation(len(data))
    rows, columns = np.divmod(data.pixel[order], width)
    across = int(width / side) + 1
    cell = (rows / side).astype(np.intp) * across + (columns / side).astype(np.intp)
    _, first = np.unique(cell, return_index=True)
    return data.take(np.sort(order[first]))
