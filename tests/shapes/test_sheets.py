"""Sheet-like shapes against their formulas."""

import numpy as np
import pytest

from mitsuba_endo.shapes import BoxPlanes, ConcaveSphere, Stomach, heightfield, make_shape


def test_plane_area_and_attitude():
    """Oracle: a tilted rectangle's area is unchanged and its normal is R_y R_x (0, 0, -1)."""
    mesh = make_shape("plane", width=60, height=40, tilt_x=0.3, tilt_y=-0.2, distance=55)
    surface = mesh.to_trimesh()
    assert surface.area == pytest.approx(60 * 40, rel=1e-12)
    sx, cx, sy, cy = np.sin(0.3), np.cos(0.3), np.sin(-0.2), np.cos(-0.2)
    normal = [-sy * cx, sx, -cy * cx]
    np.testing.assert_allclose(
        surface.face_normals, np.tile(normal, (len(mesh.faces), 1)), atol=1e-9
    )
    np.testing.assert_allclose(mesh.vertices.mean(axis=0), [0, 0, 55], atol=1e-9)


def test_bumpy_sheet_formula():
    """Oracle: the formula with its numbers written out, on a non-square sheet."""
    x, y, z = make_shape("bumpy_sheet", width=80, height=66).vertices.T
    expected = (
        70
        - (90 - np.sqrt(8100 - x * x - y * y))
        + 4 * np.sin(x / 6) * np.cos(y / 8)
        + 6 * np.exp(-((x - 8) ** 2 + (y + 5) ** 2) / 60)
    )
    np.testing.assert_allclose(z, expected, atol=1e-12)
    assert np.ptp(x) == pytest.approx(80)
    assert np.ptp(y) == pytest.approx(66)


def test_concave_sphere_radius_and_area():
    """Oracle: vertices at the radius; area r^2 * 4 asin(sin a sin b), the pyramid's solid angle."""
    shape = ConcaveSphere(radius=50, distance=65, angle_x=0.9, angle_y=0.5)
    mesh = shape.mesh()
    radii = np.linalg.norm(mesh.vertices - [0, 0, 15], axis=1)
    np.testing.assert_allclose(radii, 50, atol=1e-9)
    solid_angle = 4 * np.arcsin(np.sin(0.9) * np.sin(0.5))
    # Flat triangles lose about (edge / radius)^2 / 8 of the area: 2e-5.
    assert mesh.to_trimesh().area == pytest.approx(2500 * solid_angle, rel=1e-4)
    assert mesh.bounds[1, 2] == pytest.approx(65, abs=1e-2)


def test_box_is_three_right_angled_planes():
    """Oracle: vertices project on the three edge directions as a box corner's do."""
    box = BoxPlanes(size_a=30, size_b=20, size_c=40, edge=2)
    mesh = box.mesh()
    directions = box.edge_directions()
    np.testing.assert_allclose(directions @ directions.T, np.eye(3), atol=1e-12)
    along = (mesh.vertices - [0, 0, box.distance]) @ directions.T
    np.testing.assert_allclose(np.abs(along).min(axis=1), 0, atol=1e-9)
    np.testing.assert_allclose(along.max(axis=0), [30, 20, 40], atol=1e-9)
    assert along.min() > -1e-9
    assert mesh.to_trimesh().area == pytest.approx(30 * 20 + 20 * 40 + 40 * 30, rel=1e-9)
    assert np.all(directions[:, 2] < 0), "the corner is the furthest point"


def test_stomach_folds_between_wall_and_depth():
    """Oracle: without fine relief the folds rise from 0 to fold_depth, and reach both nearly."""
    shape = Stomach(fold_depth=5, roughness=0, seed=2)
    rise = shape.radius - np.linalg.norm(shape.mesh().vertices - shape.centre, axis=1)
    assert rise.min() >= -1e-9
    assert rise.min() < 0.05
    assert 4.5 < rise.max() <= 5 + 1e-9
    assert 0.4 < (rise > 2.5).mean() < 0.95, "thick folds cover more than the furrows"


def test_stomach_orientation_turns_the_folds():
    """Straight folds along x vary across y only: the height differs along y, hardly along x."""
    shape = Stomach(orientation=0, winding=0, roughness=0, seed=1)
    mesh = shape.mesh()
    rise = shape.radius - np.linalg.norm(mesh.vertices - shape.centre, axis=1)
    columns = len(np.unique(mesh.uv[:, 0]))
    rise = rise.reshape(-1, columns)
    assert np.ptp(rise, axis=1).max() < 1e-9
    assert np.ptp(rise, axis=0).min() > 5


def test_heightfield_grid():
    """Oracle: z is the function of x and y, at the spacing asked for."""
    mesh = heightfield(lambda x, y: 50 + 0.1 * x - 0.2 * y, 30, 20, 1.0, "slope")
    x, y, z = mesh.vertices.T
    np.testing.assert_allclose(z, 50 + 0.1 * x - 0.2 * y, atol=1e-12)
    assert len(mesh.vertices) == 31 * 21
