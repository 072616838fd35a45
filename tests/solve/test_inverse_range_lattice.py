"""Lattice surfaces against brute force."""

import numpy as np
import pytest

from mitsuba_endo.solve.surfaces.inverse_range_lattice import (
    Lattice,
    equidistant_coordinates,
    equidistant_direction,
    lattice_over,
    lattice_position,
)

CELL = 0.05


def cap(width: float, height: float, seed: int = 0) -> np.ndarray:
    """Directions spread over an off-centre rectangle of the equidistant map, with a corner cut."""
    rng = np.random.default_rng(seed)
    ab = rng.uniform([-0.3 * width, -0.6 * height], [0.7 * width, 0.4 * height], (4000, 2))
    cut = (ab[:, 0] > 0.4 * width) & (ab[:, 1] > 0.1 * height)
    return equidistant_direction(ab[~cut])


@pytest.fixture(params=[(1.0, 0.4), (0.4, 1.0)], ids=["wide", "high"])
def lattice(request: pytest.FixtureRequest) -> Lattice:
    return lattice_over(cap(*request.param), CELL, margin=0)


def test_equidistant_maps_round_trip():
    """Oracle: the inverse map, also behind the camera; the radius is the angle to the axis."""
    rng = np.random.default_rng(1)
    theta, phi = rng.uniform(0, 3.1, 500), rng.uniform(0, 2 * np.pi, 500)
    ab = theta[:, None] * np.stack([np.cos(phi), np.sin(phi)], 1)
    d = equidistant_direction(ab)
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1, atol=1e-14)
    np.testing.assert_allclose(np.arccos(d[:, 2]), theta, atol=1e-7)
    np.testing.assert_allclose(equidistant_coordinates(d), ab, atol=1e-12)
    np.testing.assert_array_equal(equidistant_coordinates(np.array([[0.0, 0, 1]])), [[0, 0]])


def test_every_direction_lies_in_a_cell_whose_corners_are_vertices():
    """Oracle: floor of the position in cells; with a margin the neighbours' corners too."""
    d = cap(1.0, 0.4)
    for margin in (0, 2):
        lattice = lattice_over(d, CELL, margin)
        have = {tuple(v) for v in lattice.ij}
        cells = np.unique(np.floor(lattice_position(d, CELL)).astype(int), axis=0)
        for dx in range(-margin, margin + 2):
            for dy in range(-margin, margin + 2):
                assert {tuple(c) for c in cells + np.array([dx, dy])} <= have


def test_triangles_tile_the_cells_and_face_one_way(lattice: Lattice):
    """Oracle: two triangles a cell, of area cell^2 / 2, with normals away from the centre."""
    ab = lattice.coordinates[lattice.faces]
    e, f = ab[:, 1] - ab[:, 0], ab[:, 2] - ab[:, 0]
    np.testing.assert_allclose(e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0], CELL**2, rtol=1e-9)
    wide = np.ptp(lattice.ij[:, 0]) > np.ptp(lattice.ij[:, 1])
    d = cap(1.0, 0.4) if wide else cap(0.4, 1.0)
    cells = np.unique(np.floor(lattice_position(d, CELL)), axis=0)
    assert len(lattice.faces) == 2 * len(cells)
    corners = lattice.vertices(np.full(lattice.size, 0.2))[lattice.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normal * corners[:, 0]).sum(1) > 0).all()
    assert len(np.unique(np.sort(lattice.faces, 1), axis=0)) == len(lattice.faces)
    assert set(lattice.faces.ravel()) == set(range(lattice.size))


def test_vertices_have_the_inverse_range(lattice: Lattice):
    """Oracle: |X| = 1 / rho along the direction."""
    rho = np.random.default_rng(2).uniform(0.05, 0.3, lattice.size)
    X = lattice.vertices(rho)
    np.testing.assert_allclose(np.linalg.norm(X, axis=1), 1 / rho)
    np.testing.assert_allclose(X * rho[:, None], lattice.directions, atol=1e-12)


def test_second_differences(lattice: Lattice):
    """Oracle: zero on functions linear in the lattice coordinates, 2 a on a i^2, none on i j."""
    D = lattice.second_differences()
    i, j = lattice.ij.T.astype(float)
    np.testing.assert_allclose(D @ (3 - 0.7 * i + 0.2 * j), 0, atol=1e-12)
    np.testing.assert_allclose(D @ (i * j), 0, atol=1e-10)
    square = D @ (i * i)
    assert set(np.round(square, 9)) == {0.0, 2.0}
    have = {tuple(v) for v in lattice.ij}
    along = sum((x + 1, y) in have and (x - 1, y) in have for x, y in have)
    across = sum((x, y + 1) in have and (x, y - 1) in have for x, y in have)
    assert D.shape == (along + across, lattice.size)
    assert (square == 2).sum() == along


def test_bandwidth_bounds_what_is_coupled(lattice: Lattice):
    """Oracle: the largest index difference in D^T D and among the corners of a triangle."""
    D = lattice.second_differences()
    row, col = (D.T @ D).tocoo().coords
    corners = np.ptp(lattice.faces, axis=1).max()
    assert lattice.bandwidth >= max(np.abs(row - col).max(), corners)
    # Numbered along the short side: three rows of it at most.
    short = int(np.ptp(lattice.ij, axis=0).min()) + 1
    assert lattice.bandwidth <= 3 * short


def test_bending_is_in_pattern_pixels(lattice: Lattice):
    """Oracle: second differences times focal length and baseline, and no offset."""
    bending = lattice.bending(330.0)
    rho = np.random.default_rng(5).uniform(0.05, 0.3, lattice.size)
    found = bending.operator @ rho + bending.offset
    np.testing.assert_allclose(found, 330 * (lattice.second_differences() @ rho), rtol=1e-12)


def test_slopes_are_how_far_vertices_move(lattice: Lattice):
    """Oracle: central differences of the vertices' positions."""
    rho = np.random.default_rng(6).uniform(0.05, 0.3, lattice.size)
    ends = [lattice.vertices(rho + h) for h in (1e-7, -1e-7)]
    moved = np.linalg.norm(ends[0] - ends[1], axis=1) / 2e-7
    np.testing.assert_allclose(np.abs(lattice.slopes(rho)), moved, rtol=1e-6)


def test_steps_never_lead_behind_the_centre(lattice: Lattice):
    """Oracle: the step where it stays in front, a twentieth of the median elsewhere."""
    rho = np.random.default_rng(7).uniform(0.1, 0.2, lattice.size)
    step = np.where(np.arange(lattice.size) % 5 == 0, -1.0, 0.03)
    found = lattice.retract(rho, step)
    np.testing.assert_array_equal(found[step > 0], (rho + step)[step > 0])
    np.testing.assert_allclose(found[step < 0], np.median(rho) / 20)


def test_bridges_over_a_depth_step(lattice: Lattice):
    """Oracle: faces with corners on both sides of a step to twice the range, and no others."""
    near = lattice.ij[:, 0] < np.median(lattice.ij[:, 0])
    rho = np.where(near, 0.2, 0.1)
    side = near[lattice.faces]
    np.testing.assert_array_equal(lattice.bridges(rho), side.any(1) & ~side.all(1))
    assert not lattice.bridges(np.full(lattice.size, 0.1)).any()


def test_record_round_trip(lattice: Lattice):
    """Oracle: the lattice itself."""
    again = Lattice.from_record(lattice.record())
    assert again.cell == lattice.cell
    np.testing.assert_array_equal(again.ij, lattice.ij)
    np.testing.assert_array_equal(again.faces, lattice.faces)


@pytest.mark.parametrize("room", [30, 10_000])
def test_coarsened_faces_lie_on_the_surface(lattice: Lattice, room: int):
    """Oracle: squares of n cells a side whose corners are vertices, as many as there is room."""
    kept, faces = lattice.coarsened(room)
    n = max(1, int(np.ceil(np.sqrt(lattice.size / room))))
    assert len(kept) <= 2 * room
    assert len(faces) > 0
    at = lattice.ij[kept][faces]
    assert (np.ptp(at, axis=1) == n).all()
    e, f = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
    assert (e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0] == n * n).all()
    if n == 1:
        np.testing.assert_array_equal(kept, np.arange(lattice.size))
        # A missing cell is covered too where its four corners belong to its neighbours.
        assert {tuple(f) for f in faces} >= {tuple(f) for f in lattice.faces}


def test_nearest(lattice: Lattice):
    """Oracle: the smallest distance in the equidistant map; -1 beyond half a cell."""
    rng = np.random.default_rng(3)
    low, high = lattice.coordinates.min(0) - 0.1, lattice.coordinates.max(0) + 0.1
    ab = rng.uniform(low, high, (600, 2))
    distance = np.abs(ab[:, None] - lattice.coordinates).max(-1)
    expected = np.where(distance.min(1) <= CELL / 2, distance.argmin(1), -1)
    found = lattice.nearest(equidistant_direction(ab))
    np.testing.assert_array_equal(found, expected)
    assert set(np.sign(found)) >= {-1, 1}


def test_fill(lattice: Lattice):
    """Oracle: brute-force search of the nearest seen vertex; seen ones keep their value."""
    rng = np.random.default_rng(4)
    seen = rng.random(lattice.size) < 0.1
    rho = np.where(seen, rng.uniform(0.1, 0.3, lattice.size), np.nan)
    filled = lattice.fill(seen, rho)
    np.testing.assert_array_equal(filled[seen], rho[seen])
    gap = np.linalg.norm(lattice.ij[:, None] - lattice.ij[seen], axis=-1)
    for v in range(lattice.size):
        assert filled[v] in rho[seen][gap[v] <= gap[v].min() + 1e-9]
