"""Distance to a mesh: closed forms, brute force, and triangles that mislead a centroid search."""

import time

import numpy as np
import pytest

from mitsuba_endo.evaluate.distance import distance_to_mesh, point_triangle_distance

TRIANGLE = np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]])


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ([1, 1, 2], 2.0),  # above the inside
        ([1, 1, 0], 0.0),  # inside
        ([1, -2, 0], 2.0),  # beside an edge
        ([-3, -4, 0], 5.0),  # beyond a corner
        ([-3, -4, 12], 13.0),  # beyond a corner and above
        ([4, 3, 0], 12 / 5),  # beyond the hypotenuse: 2 area / length
        ([7, -4, 0], 5.0),  # beyond another corner
    ],
)
def test_point_and_triangle(point: list[float], expected: float):
    """Oracle: elementary geometry of a 3-4-5 triangle, for both orientations."""
    for corners in (TRIANGLE, TRIANGLE[::-1]):
        found = point_triangle_distance(np.array([point], float), corners[None])
        np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("corners", [[[0, 0, 0]] * 3, [[0, 0, 0], [4, 0, 0], [2, 0, 0]]])
def test_triangle_without_area(corners: list):
    """Oracle: the distance to the point or segment that it is."""
    found = point_triangle_distance(np.array([[1.0, 3, 4]]), np.array([corners], float))
    np.testing.assert_allclose(found, np.sqrt(26) if corners[1] == corners[0] else 5.0)


def _soup(rng: np.random.Generator, stretch: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangles of all sizes, ``stretch`` times as long as wide, in a box of 20 mm."""
    n = 150
    corners = rng.normal(size=(n, 3, 3)) * 10 ** rng.uniform(-2, 0.5, (n, 1, 1))
    corners[..., 0] *= stretch
    turn = np.linalg.qr(rng.normal(size=(n, 3, 3)))[0]
    corners = corners @ turn + rng.uniform(-10, 10, (n, 1, 3))
    return corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3)


@pytest.mark.parametrize("stretch", [1.0, 30.0, 1000.0])
def test_against_brute_force(stretch: float):
    """Oracle: the least distance over every triangle."""
    rng = np.random.default_rng(3)
    vertices, faces = _soup(rng, stretch)
    points = rng.uniform(-15, 15, (300, 3))
    pairs = point_triangle_distance(
        np.repeat(points, len(faces), 0), np.tile(vertices[faces], (len(points), 1, 1))
    )
    expected = pairs.reshape(len(points), -1).min(1)
    np.testing.assert_array_equal(distance_to_mesh(points, vertices, faces), expected)


def test_long_triangle_hidden_behind_many_near_centroids():
    """Oracle: 0.5 mm to the long triangle's plane; its centroid is 60 mm away, others 5 mm."""
    small = np.array([[0, 0, 5.0], [0.1, 0, 5], [0, 0.1, 5]]) + np.zeros((40, 1, 1))
    long = np.array([[[-1, -1, -0.5], [-1, 1, -0.5], [200, 0, -0.5]]])
    vertices = np.concatenate([small, long]).reshape(-1, 3)
    faces = np.arange(len(vertices)).reshape(-1, 3)
    assert distance_to_mesh(np.zeros((1, 3)), vertices, faces) == pytest.approx(0.5, abs=1e-14)


def test_sphere():
    """Oracle: | |p| - radius | of a sphere; the chords of a fine mesh stay within 0.2 % of it."""
    import trimesh

    sphere = trimesh.creation.icosphere(subdivisions=4, radius=10)
    points = np.random.default_rng(0).normal(size=(500, 3)) * 8
    found = distance_to_mesh(points, np.asarray(sphere.vertices), np.asarray(sphere.faces))
    np.testing.assert_allclose(found, abs(np.linalg.norm(points, axis=1) - 10), atol=0.02)


def test_many_points_in_reasonable_time():
    """Oracle: the known offset of a shifted plane. 30,000 points take a second, not a minute."""
    x, y = np.meshgrid(np.linspace(-40, 40, 121), np.linspace(-30, 30, 91))
    vertices = np.stack([x, y, 0 * x + 70], -1).reshape(-1, 3)
    corner = (np.arange(90)[:, None] * 121 + np.arange(120)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + 121, corner + 1], -1),
            np.stack([corner + 1, corner + 121, corner + 122], -1),
        ]
    )
    points = np.random.default_rng(1).uniform([-40, -30, 70.1], [40, 30, 70.1], (30_000, 3))
    start = time.perf_counter()
    np.testing.assert_allclose(distance_to_mesh(points, vertices, faces), 0.1, atol=1e-12)
    assert time.perf_counter() - start < 30
