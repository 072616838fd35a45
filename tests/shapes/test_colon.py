"""The colon segment, its centre line and its polyps."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes import Colon, Polyp, make_shape
from mitsuba_endo.shapes.centre_line import CentreLine

BARE = {"fold_depth": 0, "tenia_depth": 0, "roughness": 0}


def test_bare_straight_tube_is_a_cylinder_with_a_dome():
    """Oracle: distance from the axis, and the areas of a cylinder and a half-sphere."""
    mesh = make_shape("colon", **BARE, bend=0, length=60, behind=10, radius=20)
    x, y, z = mesh.vertices.T
    tube = z <= 60
    np.testing.assert_allclose(np.hypot(x, y)[tube], 20, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - [0, 0, 60], axis=1)[~tube], 20)
    assert mesh.bounds[:, 2] == pytest.approx([-10, 80])
    area = 2 * np.pi * 20 * 70 + 2 * np.pi * 20**2
    assert mesh.to_trimesh().area == pytest.approx(area, rel=1e-3)


def test_open_end_has_two_rims():
    """Oracle: Euler number 0 for a tube, 1 for a tube closed at one end."""
    for closed, euler in ((False, 0), (True, 1)):
        assert make_shape("colon", closed_end=closed, edge=2).to_trimesh().euler_number == euler


def test_centre_line_turns_by_the_bend():
    """Oracle: normals stay orthonormal, steps have unit length, the end's heading is the bend."""
    line = CentreLine(start=-15, length=150, stop=175, bend=0.8, towards=0.6)
    s = np.linspace(-15, 175, 400)
    centre, first, second = line.frame(s)
    tangent = np.gradient(centre, s, axis=0)
    np.testing.assert_allclose(np.linalg.norm(tangent[1:-1], axis=1), 1, atol=1e-4)
    tangent = np.cross(first, second)
    np.testing.assert_allclose(
        (np.gradient(centre, s, axis=0) * tangent).sum(1)[1:-1], 1, atol=1e-4
    )
    np.testing.assert_allclose((first * second).sum(axis=1), 0, atol=1e-12)
    end = [np.sin(0.8) * np.cos(0.6), np.sin(0.8) * np.sin(0.6), np.cos(0.8)]
    np.testing.assert_allclose(tangent[-1], end, atol=1e-12)
    at_origin = line.frame(np.array(0.0))
    np.testing.assert_allclose(at_origin, [[0, 0, 0], [1, 0, 0], [0, 1, 0]], atol=1e-12)


def test_fold_depth_range():
    """Folds of a straight tube stand in by at most the stated depth, and the deepest by 70 %."""
    shape = Colon(bend=0, roughness=0, tenia_depth=0, fold_depth=7, closed_end=False, seed=3)
    rise = shape.radius - np.hypot(*shape.mesh().vertices.T[:2])
    assert rise.min() >= -1e-9
    assert rise.min() < 0.2
    # Where folds of two thirds overlap the p-norm adds up to 2^(1/4).
    assert 0.7 * 7 < rise.max() < 7 * 2**0.25
    assert (rise > 3.5).mean() < 0.5, "folds are ridges, not the wall"


def test_folds_alternate_between_the_thirds():
    """Each third's mean height along the tube peaks at other places than its neighbour's."""
    shape = Colon(bend=0, roughness=0, tenia_depth=0, closed_end=False, seed=3, edge=1.5)
    mesh = shape.mesh()
    x, y, z = mesh.vertices.T
    columns = int((z < z.min() + 1e-9).sum())
    rise = (shape.radius - np.hypot(x, y)).reshape(-1, columns)
    profile = rise - rise.mean(axis=0)
    third = columns // 3
    far = [np.corrcoef(profile[:, k], profile[:, k + third])[0, 1] for k in range(third)]
    near = [np.corrcoef(profile[:, k], profile[:, k + 2])[0, 1] for k in range(third)]
    assert np.mean(near) > 0.8
    assert np.mean(far) < 0.3


def fit_sphere(points):
    """Return centre and radius of the least-squares sphere."""
    start = np.append(points.mean(axis=0), 1.0)
    result = least_squares(lambda p: np.linalg.norm(points - p[:3], axis=1) - p[3], start)
    return result.x[:3], result.x[3]


@pytest.mark.parametrize("diameter", [5.0, 10.0, 15.0])
def test_polyp_diameter_from_the_mesh(diameter):
    """Oracle: a sphere fitted to the mesh where the polyp stands out has the stated diameter.

    Only points over a third of the polyp's height are used, found without the fitted radius.
    """
    polyp = Polyp(along=44, angle=2.0, diameter=diameter)
    shape = Colon(polyps=(polyp,), seed=1)
    (truth,) = shape.polyp_truth()
    mesh = shape.mesh()
    local = mesh.vertices - truth.base
    high = local @ truth.normal
    away = np.linalg.norm(local - high[:, None] * truth.normal, axis=1)
    cap = (high > diameter / 6) & (high < 0.6 * diameter) & (away < 0.6 * diameter)
    assert cap.sum() > 40
    centre, radius = fit_sphere(mesh.vertices[cap])
    assert 2 * radius == pytest.approx(diameter, rel=1e-6)
    np.testing.assert_allclose(centre, truth.centre, atol=1e-5)
    apex = (high * (away < 0.6 * diameter) * (high < diameter)).max()
    assert apex == pytest.approx(diameter / 2, rel=0.02)  # the nearest vertex misses the apex


def test_flat_polyp_and_untouched_wall():
    """Oracle: sphere through base circle and top; far from the polyp the wall is the same."""
    polyp = Polyp(along=30, angle=5.0, diameter=9, height=2.5)
    shape = Colon(**BARE, polyps=(polyp,), bend=0)
    (truth,) = shape.polyp_truth()
    assert truth.sphere_radius == pytest.approx((4.5**2 + 2.5**2) / 5)
    wall = 24 * np.array([np.cos(5.0), np.sin(5.0), 0]) + [0, 0, 30]
    np.testing.assert_allclose(truth.base, wall, atol=1e-9)
    np.testing.assert_allclose(truth.normal, [-np.cos(5.0), -np.sin(5.0), 0], atol=1e-6)
    x, y, z = shape.mesh().vertices.T
    rise = 24 - np.hypot(x, y)
    tube = z < 170
    assert rise[tube].max() == pytest.approx(2.5, abs=0.02)
    far = tube & (np.linalg.norm(np.stack([x, y, z], 1) - wall, axis=1) > 15)
    np.testing.assert_allclose(rise[far], 0, atol=1e-9)


def test_mesh_with_polyps_is_manifold_and_unfolded():
    """Oracle: trimesh's checks, and every face of the cap turned into the lumen."""
    polyps = [
        {"along": 40, "angle": 0.1, "diameter": 8},
        {"along": 75, "angle": 3.3, "diameter": 12, "height": 4},
    ]
    shape = Colon(polyps=polyps, seed=6)  # pyright: ignore[reportArgumentType]
    mesh = shape.mesh().to_trimesh()
    assert mesh.is_winding_consistent
    assert mesh.area_faces.min() > 1e-3
    for truth in shape.polyp_truth():
        near = np.linalg.norm(mesh.triangles_center - truth.base, axis=1) < 0.5 * truth.diameter
        assert (mesh.face_normals[near] @ truth.normal).min() > -1e-3


@pytest.mark.parametrize(
    ("polyp", "says"),
    [
        ({"along": 500, "angle": 0, "diameter": 5}, "polyps.0.along: .*outside the segment"),
        ({"along": 50, "angle": 0, "diameter": 5, "height": 9}, "polyp: height"),
        ({"along": 50, "angle": 0, "diameter": -5}, "polyps.0.diameter"),
        ({"along": 50, "angle": 0}, "polyps.0.diameter: .*required"),
    ],
)
def test_bad_polyps_are_named(polyp, says):
    with pytest.raises(InputError, match=says):
        make_shape("colon", polyps=[polyp])
