"""Signed-distance solids and their meshing."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsuba_endo.shapes import make_shape
from mitsuba_endo.shapes.sdf import ellipsoid, rounded_cone, smooth_difference, smooth_union
from mitsuba_endo.shapes.surface_nets import mesh_field


def torus(points):
    ring = np.hypot(points[..., 0], points[..., 1]) - 8.0
    return np.hypot(ring, points[..., 2]) - 3.0


def test_ellipsoid_volume_and_surface():
    """Oracle: volume 4/3 pi abc, and the implicit equation at every vertex."""
    turn = Rotation.from_euler("xyz", [0.4, -0.7, 1.1])
    field = ellipsoid((1, 2, -1), (9, 6, 4), turn)
    mesh = mesh_field(field, (-10, -9, -12), (12, 13, 10), 0.5)
    surface = mesh.to_trimesh()
    assert surface.is_watertight
    assert surface.euler_number == 2
    # Chords lose about (cell / radius)^2 / 4 of the volume: below 0.5 %.
    assert surface.volume == pytest.approx(4 / 3 * np.pi * 9 * 6 * 4, rel=5e-3)
    local = (mesh.vertices - [1, 2, -1]) @ turn.as_matrix() / [9, 6, 4]
    np.testing.assert_allclose((local**2).sum(axis=1), 1, atol=1e-6)


def test_torus_topology_and_volume():
    """Oracle: Euler number 0, volume 2 pi^2 R r^2, outward normals (positive volume)."""
    surface = mesh_field(torus, (-12, -12, -4), (12, 12, 4), 0.4).to_trimesh()
    assert surface.is_watertight
    assert surface.euler_number == 0
    assert surface.volume == pytest.approx(2 * np.pi**2 * 8 * 9, rel=1e-2)


def test_pinched_spheres_stay_manifold():
    """Two spheres that all but touch: every edge still joins exactly two faces, at many sizes."""
    left, right = ellipsoid((-4.03, 0.1, 0), (4, 4, 4)), ellipsoid((4.03, 0, 0.2), (4, 4, 4))
    for cell in (0.5, 0.61, 0.83):
        field = lambda p: smooth_union(left(p), right(p), 0.4)  # noqa: E731
        surface = mesh_field(field, (-9, -5, -5), (9, 5, 5), cell).to_trimesh()
        assert surface.is_watertight


def test_surface_outside_the_box_is_refused():
    with pytest.raises(ValueError, match="leaves the box"):
        mesh_field(ellipsoid((0, 0, 0), (5, 5, 5)), (-4, -6, -6), (6, 6, 6), 0.5)
    with pytest.raises(ValueError, match="no surface"):
        mesh_field(ellipsoid((0, 0, 0), (1, 1, 1)), (4, 4, 4), (6, 6, 6), 0.5)


def test_rounded_cone_of_equal_radii_is_a_capsule():
    """Oracle: distances to a segment, worked by hand."""
    field = rounded_cone((0, 0, 0), (10, 0, 0), 2, 2)
    points = np.array([[5, 5, 0], [-3, 0, 0], [13, 4, 0], [5, 0, 1]])
    np.testing.assert_allclose(field(points), [3, 1, 3, -1], atol=1e-12)


def test_smooth_union_and_difference():
    """Far from each other they are min and max; where equal they differ from it by blend / 6."""
    a, b = np.array([1.0, 4.0]), np.array([5.0, 4.0])
    np.testing.assert_allclose(smooth_union(a, b, 1.5), [1.0, 4.0 - 0.25])
    np.testing.assert_allclose(smooth_difference(a, -b, 1.5), [5.0, 4.0 + 0.25])


def test_rabbit_is_one_closed_solid_of_the_asked_height():
    """Oracle: genus 0; height by bounds; volume grows with the cube of the height."""
    small = make_shape("rabbit", height=30, edge=0.5, yaw=0.2).to_trimesh()
    large = make_shape("rabbit", height=60, edge=1.0, yaw=1.2).to_trimesh()
    for mesh, height in ((small, 30), (large, 60)):
        assert mesh.is_watertight
        assert mesh.euler_number == 2
        # The nominal height is 66 units of about 68: feet and ear tips round off.
        assert np.ptp(mesh.bounds[:, 1]) == pytest.approx(height, rel=0.04)
    assert large.volume / small.volume == pytest.approx(8, rel=1e-3)


def test_rabbit_stands_upright_and_yaw_turns_its_nose():
    """Ears (above the head) are at negative y; the nose points to +x at yaw pi/2."""
    mesh = make_shape("rabbit", yaw=np.pi / 2, edge=1.0)
    x, y, z = mesh.vertices.T
    ears = y < y.min() + 12
    feet = y > y.max() - 12
    assert np.ptp(x[ears]) < 0.5 * np.ptp(x[feet])
    nose = (np.abs(z - 75) < 1.5) & (np.abs(y + 3) < 6)
    assert x[nose].max() > 15 > -x[nose].min()
