"""Shape errors and coverage against planes in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_endo.evaluate.alignment import align
from mitsuba_endo.evaluate.shape import Lighting, ShapeErrors, compare_shape
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate

pytestmark = pytest.mark.usefixtures("llvm")


def _errors(found: ShapeErrors | str) -> ShapeErrors:
    assert not isinstance(found, str)
    return found


def _tilted_points(world: SimpleNamespace, depth: float, slope: tuple[float, float]) -> np.ndarray:
    """(H, W, 3) points of the plane z = depth + slope . (x, y) on the camera's rays."""
    rays = world.camera.grid_rays
    along = depth / (rays[..., 2] - slope[0] * rays[..., 0] - slope[1] * rays[..., 1])
    return rays * along[..., None]


def test_shifted_plane(world: SimpleNamespace):
    """Oracle: 0.1 mm to the nearest point everywhere; 0.1 / cos(theta) along the rays."""
    patch = world.sheet(70.1, low=(-20, -15), high=(18, 21))
    found = _errors(compare_shape(patch, world.sheet(), world.camera))
    assert found.rmse == pytest.approx(0.1, rel=1e-9)
    assert found.median == pytest.approx(0.1, rel=1e-9)
    points = _tilted_points(world, 70.1, (0, 0))
    on_patch = ((points[..., :2] > [-20, -15]) & (points[..., :2] < [18, 21])).all(-1)
    expected = 0.1 / world.camera.grid_rays[on_patch][:, 2]
    assert found.ray_rmse == pytest.approx(np.sqrt(np.mean(expected**2)), rel=1e-9)
    assert found.coverage == pytest.approx(on_patch.mean(), abs=1e-12)
    assert found.alignment_scale == 1


def test_rmse_and_median_differ_for_an_outlier(world: SimpleNamespace):
    """Oracle: one of 49 vertices lifted by 7 mm: RMSE 1 mm, median 0; unused vertices ignored."""
    surface = world.sheet()
    vertices = surface.vertices.copy()
    vertices[24, 2] -= 7
    vertices = np.concatenate([vertices, [[0, 0, 1000.0]]])
    bumped = SurfaceEstimate(vertices, surface.faces)
    found = _errors(compare_shape(bumped, world.sheet(), world.camera))
    assert found.rmse == pytest.approx(np.sqrt(49 / 49), rel=1e-9)
    assert found.median == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("alignment", ["scale", "similarity"])
def test_scale_is_taken_out(world: SimpleNamespace, alignment):
    """Oracle: a solution in multiples of a 6.3 mm baseline is the truth after scaling by 6.3."""
    truth = world.sheet(slope=(0.2, -0.1))
    small = SurfaceEstimate(truth.vertices / 6.3, truth.faces)
    found = _errors(compare_shape(small, truth, world.camera, alignment=alignment))
    assert found.alignment_scale == pytest.approx(6.3, rel=1e-9)
    assert found.rmse < 1e-8
    assert found.ray_rmse is not None
    assert found.ray_rmse < 1e-8
    assert found.coverage == 1


@pytest.mark.parametrize(
    ("alignment", "scale", "rotation"),
    [("scale", True, False), ("rigid", False, True), ("similarity", True, True)],
)
def test_alignment_is_that_of_the_pairs_on_rays(
    world: SimpleNamespace, alignment, scale: bool, rotation: bool
):
    """Oracle: the closed-form points of two tilted planes, aligned and compared with no mesh."""
    source = _tilted_points(world, 68, (0.22, -0.1)).reshape(-1, 3)
    target = _tilted_points(world, 70, (0.2, -0.12)).reshape(-1, 3)
    expected = align(source, target, scale=scale, rotation=rotation)
    wide = {"low": (-90, -80), "high": (90, 80)}
    surfaces = world.sheet(68, (0.22, -0.1), **wide), world.sheet(70, (0.2, -0.12), **wide)
    found = _errors(compare_shape(*surfaces, world.camera, alignment=alignment))
    assert found.alignment_scale == pytest.approx(expected.scale, rel=1e-9)
    normal = np.array([0.2, -0.12, -1]) / np.linalg.norm([0.2, -0.12, -1])
    heights = expected.apply(surfaces[0].vertices) @ normal + 70 / np.linalg.norm([0.2, -0.12, -1])
    inside = (np.abs(expected.apply(surfaces[0].vertices)[:, :2]) < [88, 78]).all(-1)
    assert np.median(np.abs(heights[inside])) <= found.rmse <= np.abs(heights).max() + 3


def test_coverage_counts_what_the_pattern_lights(world: SimpleNamespace):
    """Oracle: pixels whose point projects onto the pattern, by the projector's own formula."""
    lighting = Lighting(world.projector, world.size, world.pose)
    # 17.9, not 18: a ray exactly along an edge inside the patch slips through Embree's fast mode.
    patch = world.sheet(low=(-20, -15), high=(17.9, 21))
    found = _errors(compare_shape(patch, world.sheet(), world.camera, lighting))
    points = _tilted_points(world, 70, (0, 0))
    q = world.projector.project(world.pose.apply(points))
    lit = ((q >= -0.5) & (q <= np.array(world.size) - 0.5)).all(-1)
    on_patch = ((points[..., :2] > [-20, -15]) & (points[..., :2] < [17.9, 21])).all(-1)
    assert 0.2 < lit.mean() < 0.9
    assert found.coverage == pytest.approx(on_patch[lit].mean(), abs=1e-12)


def test_shadow_does_not_count(world: SimpleNamespace):
    """Oracle: a near strip's shadow on the wall, by intersecting lines to the projector."""
    strip = world.sheet(50, low=(-4, -40), high=(4, 40))
    wall = world.sheet()
    n = len(wall.vertices)
    truth = SurfaceEstimate(
        np.concatenate([wall.vertices, strip.vertices]),
        np.concatenate([wall.faces, strip.faces + n]),
    )
    pose = RigidTransform.of([0.0, 0, 0], [-15.0, 0, 0])  # the projector is 15 mm to the right
    projector = world.projector.with_(focal=40.0)  # wide enough to light all that is seen
    lighting = Lighting(projector, world.size, pose)
    found = _errors(compare_shape(strip, truth, world.camera, lighting))
    points = _tilted_points(world, 70, (0, 0))
    hidden = np.abs(points[..., 0] * 50 / 70) < 4  # behind the strip, whose own pixels these are
    at_strip = 15 + (points[..., 0] - 15) * 50 / 70
    shadowed = (np.abs(at_strip) < 4) & ~hidden
    assert shadowed.sum() > 100
    q = projector.project(pose.apply(points))
    assert ((q >= -0.5) & (q <= np.array(world.size) - 0.5)).all()
    expected = hidden.sum() / (points[..., 0].size - shadowed.sum())
    assert found.coverage == pytest.approx(expected, abs=1e-12)


def test_surfaces_on_different_sides(world: SimpleNamespace):
    """Oracle: no ray meets both: a reason where an alignment needs them, else null, coverage 0."""
    left = world.sheet(low=(-30, -20), high=(-5, 20))
    right = world.sheet(low=(5, -20), high=(30, 20))
    assert isinstance(compare_shape(left, right, world.camera, alignment="scale"), str)
    found = _errors(compare_shape(left, right, world.camera))
    assert found.ray_rmse is None
    assert found.coverage == 0
    np.testing.assert_allclose(found.median, 10 + 25 / 2)
