"""From range images to one mesh."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from .clean import clean
from .decimate import decimate
from .frame import RangeFrame
from .surface_nets import RawSurface, extract
from .tsdf import Volume

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

SMALLEST_ISLAND = 0.01
"""Share of the whole area below which a piece that hangs together with nothing is dropped."""


@dataclass(frozen=True, eq=False)
class FusedMesh:
    """A surface that frames have in common, in the world and the unit of their ranges.

    It is a manifold with borders: every edge has one or two faces, every vertex one fan of them,
    and all vertices are used.
    """

    vertices: Floats
    """(V, 3)."""
    faces: Index
    """(F, 3), counter-clockwise seen from the cameras' side."""
    normals: Floats
    """(V, 3) unit, towards the cameras' side; mean of the faces' by area."""
    frames: Index
    """(V,) how many frames measured the surface there."""
    std: Floats
    """(V,) a guess at the standard deviation along the normal, from how much frames disagree; it
    knows nothing of errors that they share. NaN where no two frames measured anything in common."""


def voxel_size(frames: Sequence[RangeFrame]) -> float:
    """Return the frames' median size of a pixel on the surface: what they can resolve."""
    footprints = [frame.footprint for frame in frames if frame.valid.any()]
    if not footprints:
        raise ValueError("no frame has seen anything, so there is nothing to fuse")
    return float(np.median(footprints))


def fuse(
    frames: Sequence[RangeFrame],
    *,
    voxel: float | None = None,
    vertices: int | None = None,
    smallest_island: float = SMALLEST_ISLAND,
) -> FusedMesh:
    """Fuse range images into one mesh.

    Args:
        frames: with a common world, in any order.
        voxel: side of a voxel, the unit of the ranges. None: :func:`voxel_size`.
        vertices: about how many to keep. None: as fine as the voxels.
        smallest_island: share of the whole area below which a separate piece is dropped.

    Raises:
        ValueError: nothing was seen, or no two pixels beside each other.
    """
    volume = Volume(voxel_size(frames) if voxel is None else voxel)
    for frame in frames:
        volume.integrate(frame)
    return surface_of(volume, vertices=vertices, smallest_island=smallest_island)


def surface_of(
    volume: Volume, *, vertices: int | None = None, smallest_island: float = SMALLEST_ISLAND
) -> FusedMesh:
    """Return the surface that a volume holds so far, see :func:`fuse`."""
    raw = extract(volume)
    if not len(raw.faces):
        raise ValueError("the frames hold no piece of surface larger than a voxel")
    faces, kept = clean(raw.vertices, raw.faces, smallest_island)
    points = raw.vertices[kept]
    if vertices is not None:
        points, faces = decimate(points, faces, vertices)
        kept = kept[KDTree(raw.vertices[kept]).query(points)[1]]
    return FusedMesh(
        points, faces, vertex_normals(points, faces), raw.frames[kept], _deviations(raw)[kept]
    )


def vertex_normals(vertices: Floats, faces: Index) -> Floats:
    """Return unit normals (V, 3), the mean of the faces' around each vertex by area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a).repeat(3, axis=0)
    sums = [np.bincount(faces.ravel(), normal[:, k], len(vertices)) for k in range(3)]
    summed = np.stack(sums, -1)
    return summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300)


def _deviations(raw: RawSurface) -> Floats:
    """Return the standard deviations (V,) of means of weighted distances.

    Weights say how frames compare, and the scatter of all vertices that several saw says how large
    the variance of a weight of one is.
    """
    spare = np.maximum(raw.frames - 1, 0).sum()
    unit = raw.scatter[raw.frames > 1].sum() / spare if spare else np.nan
    return np.sqrt(unit / raw.weight)
