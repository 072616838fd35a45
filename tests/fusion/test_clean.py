"""Small meshes with one fault each."""

import numpy as np

from mitsuba_endo.fusion.clean import clean

FLAT = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [2, 2, 0], [1, 2, 0.0]])


def test_faces_without_area_doubles_and_unused_vertices_go() -> None:
    faces = np.array([[0, 1, 2], [1, 3, 2], [1, 2, 0], [0, 0, 1], [0, 3, 3]])
    new, kept = clean(FLAT, faces)
    assert sorted(map(tuple, np.sort(kept[new], axis=1).tolist())) == [(0, 1, 2), (1, 2, 3)]
    assert sorted(kept.tolist()) == [0, 1, 2, 3]


def test_an_edge_with_three_faces_is_taken_apart() -> None:
    """A fin on an edge of two triangles gets vertices of its own; no face is lost."""
    faces = np.array([[0, 1, 2], [1, 3, 2], [1, 2, 4]])
    new, kept = clean(FLAT, faces)
    assert len(new) == 3
    assert np.array_equal(np.sort(kept[new], axis=1), np.sort(faces, axis=1))
    assert len(np.unique(new)) == 9


def test_fans_that_touch_in_a_vertex_get_one_each() -> None:
    faces = np.array([[0, 1, 3], [0, 3, 2], [3, 5, 6]])
    new, kept = clean(FLAT, faces)
    assert np.array_equal(kept[new], faces)
    assert len(kept) == 7
    assert new[2, 0] not in new[:2]


def test_an_edge_twice_in_one_fan_loses_its_smaller_faces() -> None:
    """Tetrahedra around one edge, glued at both ends: doubling vertices cannot help."""
    rng = np.random.default_rng(0)
    points = np.vstack([[0, 0, -1], [0, 0, 1], rng.normal((3, 0, 0), 1, (4, 3))])
    ring = [(2, 3), (3, 4), (4, 5), (5, 2)]
    faces = np.array([[0, a, b] for a, b in ring] + [[1, b, a] for a, b in ring])
    faces = np.vstack([faces, [[0, 1, 2], [1, 0, 4], [0, 1, 3]]])
    new, kept = clean(points, faces)
    ends = np.sort(new[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert np.unique(ends, axis=0, return_counts=True)[1].max() <= 2
    assert len(new) >= len(faces) - 3
    assert kept.max() < 6


def test_islands_below_the_share_go() -> None:
    points = np.vstack([FLAT[:4] * 10, FLAT[:3] + 50])
    faces = np.array([[0, 1, 2], [1, 3, 2], [4, 5, 6]])
    assert len(clean(points, faces, 0.01)[0]) == 2
    assert len(clean(points, faces, 0.001)[0]) == 3
