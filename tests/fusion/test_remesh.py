"""Meshes with edges as long as asked, and curvature. Oracles: planes, spheres, cylinders."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.fusion.clean import areas
from mitsuba_endo.fusion.curvature import curvatures
from mitsuba_endo.fusion.fuse import vertex_normals
from mitsuba_endo.fusion.remesh import remesh
from tests.fusion.views import edge_counts

Floats = NDArray[np.float64]
WIDTH, HEIGHT, FINE = 31.0, 22.0, 0.25


def sheet(fine: float = FINE) -> tuple[Floats, NDArray[np.int64]]:
    """A triangulated rectangle, its vertices off their grid and numbered at random."""
    rng = np.random.default_rng(2)
    columns, rows = round(WIDTH / fine) + 1, round(HEIGHT / fine) + 1
    x, y = np.meshgrid(np.linspace(0, WIDTH, columns), np.linspace(0, HEIGHT, rows))
    inner = (x > 0) & (x < WIDTH) & (y > 0) & (y < HEIGHT)
    x, y = (c + np.where(inner, rng.uniform(-0.2, 0.2, x.shape) * fine, 0.0) for c in (x, y))
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
    faces = np.concatenate([np.stack(t, -1).reshape(-1, 3) for t in ([a, b, c], [b, d, c])])
    order = rng.permutation(x.size)
    place = np.argsort(order)
    return np.stack([x, y, 0 * x], -1).reshape(-1, 3)[order], place[faces]


def sides(vertices: Floats, faces: NDArray[np.int64]) -> Floats:
    """(F, 3) lengths."""
    return np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2)


@pytest.mark.parametrize("edge", [0.8, 1.6])
def test_edges_are_as_long_as_asked(edge: float) -> None:
    """Oracle: the length asked for, within a factor of two; no slivers, and none turned over."""
    vertices, faces = sheet()
    new, triangles = remesh(vertices, faces, np.full(len(vertices), edge))
    length = sides(new, triangles)
    assert np.median(length) == pytest.approx(edge, rel=0.15)
    assert np.quantile(length, 0.01) > edge / 2
    assert np.quantile(length, 0.99) < 2 * edge
    ratio = areas(new, triangles) / (length.max(1) ** 2 * np.sqrt(3) / 4)
    assert np.quantile(ratio, 0.1) > 0.4
    a, b, c = (new[triangles[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_the_mesh_keeps_its_border_and_is_a_manifold() -> None:
    """Oracle: the rectangle's area and corners to an edge's width; no edge of three faces."""
    vertices, faces = sheet()
    edge = 1.5
    new, triangles = remesh(vertices, faces, np.full(len(vertices), edge))
    assert areas(new, triangles).sum() == pytest.approx(WIDTH * HEIGHT, rel=0.02)
    assert np.abs(new.min(0) - [0, 0, 0]).max() == 0
    assert np.abs(new.max(0) - [WIDTH, HEIGHT, 0]).max() == 0
    assert len(edge_counts(triangles)) == 3
    assert np.array_equal(np.unique(triangles), np.arange(len(new)))


def test_edges_follow_the_place() -> None:
    """Oracle: edges asked to grow fourfold from left to right do so."""
    vertices, faces = sheet()
    new, triangles = remesh(vertices, faces, 0.6 + 1.8 * vertices[:, 0] / WIDTH)
    middle, length = new[triangles].mean(1)[:, 0], sides(new, triangles).mean(1)
    for low in (2.0, 10.0, 18.0, 25.0):
        here = (middle > low) & (middle < low + 4)
        assert length[here].mean() == pytest.approx(0.6 + 1.8 * (low + 2) / WIDTH, rel=0.15)


def test_edges_longer_than_the_mesh_leave_something() -> None:
    """Oracle: one triangle at least, as wide as the sheet and no wider."""
    vertices, faces = sheet(1.0)
    new, triangles = remesh(vertices, faces, np.full(len(vertices), 0.6 * HEIGHT))
    assert len(triangles)
    assert sides(new, triangles).max() <= np.hypot(WIDTH, HEIGHT)


@pytest.mark.parametrize(("across", "expected"), [("cylinder", 0.5**0.5), ("sphere", 1.0)])
def test_curvature(across: str, expected: float) -> None:
    """Oracle: 1 / R in both directions of a sphere, in one of a cylinder; RMS over all."""
    flat, faces = sheet()
    R = 40.0
    x, y = flat[:, 0] - WIDTH / 2, flat[:, 1] - HEIGHT / 2
    z = np.sqrt(R**2 - x**2 - (y**2 if across == "sphere" else 0))
    vertices = np.stack([x, y, z], -1)
    bent = curvatures(vertices, faces, vertex_normals(vertices, faces), 8)
    inner = (np.abs(x) < WIDTH / 2 - 2) & (np.abs(y) < HEIGHT / 2 - 2)
    assert np.sqrt(np.mean(bent[inner] ** 2)) == pytest.approx(expected / R, rel=0.1)
    assert np.quantile(bent[inner], [0.02, 0.98]) == pytest.approx([expected / R] * 2, rel=0.35)
