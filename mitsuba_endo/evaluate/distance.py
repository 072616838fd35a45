"""Exact distance from points to a triangle mesh."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

Floats = NDArray[np.float64]

_BLOCK = 4096
"""Points looked at together, to bound memory. Chosen."""
_NEAREST = 8
"""Triangles tried first, by their centroids. Chosen: it speeds up the exact search, no more."""


def distance_to_mesh(points: Floats, vertices: Floats, faces: NDArray[np.int64]) -> Floats:
    """Return the distance of each point to the nearest point of a triangle mesh.

    Exact however long the triangles are. A triangle of radius r about its centroid c is no nearer
    to p than |p - c| - r; so all that can be nearer than an upper bound d, the exact distance to
    the triangles of a few near centroids, have |p - c| <= d + r. Triangles are searched in classes
    of like radius, lest one long triangle widens the search for all.

    Args:
        points: (P, 3).
        vertices: (V, 3), same frame and unit.
        faces: (F, 3) vertex indices.

    Returns:
        (P,) distances, the unit of the points.
    """
    corners = vertices[faces]
    centroids = corners.mean(1)
    radii = np.linalg.norm(corners - centroids[:, None], axis=-1).max(1)
    classes = _radius_classes(radii)
    trees = [KDTree(centroids[members]) for members in classes]
    result = np.empty(len(points))
    for start in range(0, len(points), _BLOCK):
        block = points[start : start + _BLOCK]
        best = np.full(len(block), np.inf)
        for members, tree in zip(classes, trees, strict=True):
            _lower_by_nearest(best, block, corners[members], tree)
        for members, tree in zip(classes, trees, strict=True):
            _lower_by_candidates(best, block, corners[members], radii[members].max(), tree)
        result[start : start + _BLOCK] = best
    return result


def point_triangle_distance(p: Floats, corners: Floats) -> Floats:
    """Return the distance of points (N, 3) to one triangle (N, 3, 3) each.

    The distance to the plane where the foot of the perpendicular is inside, else that to the
    nearest edge; triangles without area count as their edges.
    """
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.sum(normal * normal, -1)
    inside = squared > 0
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.sum(np.cross(end - start, p - start) * normal, -1) >= 0
    edges = np.minimum.reduce([_segment(p, a, b), _segment(p, b, c), _segment(p, c, a)])
    height = np.abs(np.sum((p - a) * normal, -1)) / np.sqrt(np.where(inside, squared, 1.0))
    return np.where(inside, height, edges)


def _segment(p: Floats, start: Floats, end: Floats) -> Floats:
    along = end - start
    squared = np.sum(along * along, -1)
    share = np.sum((p - start) * along, -1) / np.where(squared > 0, squared, 1.0)
    return np.linalg.norm(p - start - np.clip(share, 0, 1)[:, None] * along, axis=-1)


def _radius_classes(radii: Floats) -> list[NDArray[np.int64]]:
    """Group triangle indices by radius, a factor of two a class."""
    octave = np.ceil(np.log2(np.maximum(radii, 1e-9 * radii.max() + 1e-300))).astype(int)
    return [np.flatnonzero(octave == o) for o in np.unique(octave)]


def _lower_by_nearest(best: Floats, points: Floats, corners: Floats, tree: KDTree) -> None:
    k = min(_NEAREST, len(corners))
    _, index = tree.query(points, k=k)
    index = np.asarray(index).reshape(len(points), k)
    for column in index.T:
        np.minimum(best, point_triangle_distance(points, corners[column]), out=best)


def _lower_by_candidates(
    best: Floats, points: Floats, corners: Floats, radius: float, tree: KDTree
) -> None:
    lists = tree.query_ball_point(points, best + radius)
    counts = np.fromiter(map(len, lists), int, len(lists))
    if not counts.sum():
        return
    triangle = np.concatenate([np.asarray(x, int) for x in lists if x])
    point = np.repeat(np.arange(len(points)), counts)
    for part in np.array_split(np.arange(len(point)), 1 + len(point) // 500_000):
        distance = point_triangle_distance(points[point[part]], corners[triangle[part]])
        np.minimum.at(best, point[part], distance)
