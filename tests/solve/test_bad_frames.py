"""Bad frames among good ones: left out by name with a reason, and the rest is solved.

Oracle for the rest: the views' truth; for the reason: what was done to the frame.
"""

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.range_scenes import Surface, random_relief
from tests.solve.views import (
    POSE,
    Views,
    assert_near,
    focal_error,
    frame_errors,
    look,
    projector_poses,
    steps,
)

pytestmark = pytest.mark.usefixtures("llvm")

QUICK = Options(jackknife=False, check_model=False)
FAR = RigidTransform.of([0, 0, 0], [110.0, 70.0, 0.0])
"""A camera that sees nothing of what one at the origin sees, which is 75 mm wide."""


@pytest.fixture(scope="module")
def views(three_views: Views) -> Views:
    return three_views


def assert_left_out(result: Calibration, *names: str) -> None:
    """Exactly these frames are missing, each with a reason that is also a warning."""
    solution = result.solution
    assert {f.name for f in solution.left_out} == set(names)
    assert not {f.name for f in solution.frames} & set(names)
    for left in solution.left_out:
        assert left.reason
        assert any(left.name in w and left.reason in w for w in solution.warnings)


def assert_rest_right(views: Views, result: Calibration) -> None:
    assert_near(views, result.solution, focal=3e-3)


def garbage(kind: str, views: Views) -> np.ndarray:
    shape, rng = views.maps[0].q.shape, np.random.default_rng(5)
    y, x = np.mgrid[: shape[0], : shape[1]]
    if kind == "random":
        return rng.uniform(0, 1, shape) * [511, 399]
    if kind == "smooth":
        bent = [255 + 80 * np.sin(x / 20) + 60 * np.cos(y / 17), 200 + 90 * np.sin(y / 15 + x / 30)]
        return np.stack(bent, -1)
    if kind == "empty":
        return np.full(shape, np.nan)
    if kind == "one pattern pixel":
        return views.maps[2].q / 512
    if kind == "beyond the pattern":
        return views.maps[2].q * 3
    if kind == "x and y swapped":
        return views.maps[2].q[..., ::-1]
    other = random_relief(np.random.default_rng(3), 2.5)
    return look(other, [RigidTransform.identity()], [POSE]).maps[0].q.astype(np.float64)


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("random", "epipolar residuals"),
        ("smooth", "in front of camera and projector"),
        ("empty", "0 usable correspondences"),
        ("one pattern pixel", "span only"),
        ("beyond the pattern", "lie on the pattern"),
        ("x and y swapped", "are swapped"),
        ("another surface", "against view0"),
    ],
)
def test_garbage_among_good_frames(views: Views, kind: str, reason: str) -> None:
    result = calibrate(views.with_map(2, garbage(kind, views)).maps, views.rig(), QUICK)
    assert_left_out(result, "view2")
    assert reason in result.solution.left_out[0].reason
    assert_rest_right(views, result)


def test_first_frame_is_garbage(views: Views) -> None:
    """The others have a world, and a unit of length, of their own: its baseline is not theirs."""
    result = calibrate(views.with_map(0, garbage("random", views)).maps, views.rig(), QUICK)
    assert_left_out(result, "view0")
    solution = result.solution
    assert solution.units == "baseline"
    assert any("scale.baseline" in w for w in solution.warnings)
    assert solution.frames[0].world_from_camera.status == "fixed"
    assert abs(focal_error(solution)) < 3e-3
    second = solution.frames[1].world_from_camera.to_transform()
    assert second is not None
    unit = np.linalg.norm(views.projector_from_camera[1].t)
    true = views.world_from_camera[1].inverse() @ views.world_from_camera[2]
    np.testing.assert_allclose(unit * second.t, true.t, atol=0.1)


def test_known_distance_in_a_later_frame(views: Views) -> None:
    """Its frame is counted among those given, not among those used."""
    maps = views.with_map(0, garbage("random", views)).maps
    (x0, y0), (x1, y1) = pixels = (25, 30), (80, 52)
    mm = float(np.linalg.norm(views.points[2][y0, x0] - views.points[2][y1, x1]))
    known = {"pixels": pixels, "mm": mm, "std": 0.01 * mm, "frame": 2}
    solution = calibrate(maps, views.rig(scale={"known_distance": known}), QUICK).solution
    assert (solution.units, solution.scale_std_percent) == ("mm", pytest.approx(1.0))
    for frame in solution.frames:
        # Two noisy points, 0.15 mm each, some 40 mm apart.
        assert abs(frame_errors(views, frame).baseline) < 0.01
    std = solution.frames[0].projector_from_camera.std
    assert std is not None
    assert np.linalg.norm(std[3:]) > 0.01 * views.baseline, "the distance's own uncertainty"
    gone = {"known_distance": {**known, "frame": 0}}
    solution = calibrate(maps, views.rig(scale=gone), QUICK).solution
    assert solution.units == "baseline"
    assert any("scale.known_distance" in w for w in solution.warnings)


def test_frames_that_do_not_overlap(surface: Surface) -> None:
    """The stray one is left out, the others are as without it."""
    views = look(surface, [*steps(3), FAR], projector_poses(4))
    result = calibrate(views.maps, views.rig(), QUICK)
    assert_left_out(result, "view3")
    assert_rest_right(views, result)


def test_two_frames_without_overlap(surface: Surface) -> None:
    """Nothing joins them: the first is solved alone."""
    views = look(surface, [RigidTransform.identity(), FAR], projector_poses(2))
    result = calibrate(views.maps, views.rig(), QUICK)
    assert_left_out(result, "view1")
    assert_rest_right(views, result)


def test_identity_start_on_another_surface(views: Views) -> None:
    """No registration looks at these frames: the joint solution exposes the stranger."""
    maps = views.with_map(2, garbage("another surface", views)).maps
    result = calibrate(
        maps, views.rig(), Options(cameras="identity", jackknife=False, check_model=False)
    )
    assert_left_out(result, "view2")
    assert "surface of the other frames" in result.solution.left_out[0].reason
    assert_rest_right(views, result)


@pytest.mark.parametrize("share", [{}, {"surface": "per_frame", "projector_pose": "shared"}])
def test_copies_count_once(views: Views, share: dict[str, str]) -> None:
    """Oracle: the result without the copy."""
    maps, rig = views.maps[:1], views.rig(share=share)
    copy = CorrespondenceMap(views.maps[0].q.copy(), "copy")
    result = calibrate([*maps, copy], rig, QUICK)
    assert_left_out(result, "copy")
    assert "copy of view0" in result.solution.left_out[0].reason
    alone = calibrate(maps, rig, QUICK).solution.projector.focal
    # Rounding on its way through the lattice of a joint problem.
    assert result.solution.projector.focal.value == pytest.approx(alone.value, rel=1e-4)
    assert result.solution.projector.focal.std == pytest.approx(alone.std, rel=0.2)


def test_nearly_identical_frames(surface: Surface) -> None:
    """Two captures from one place differ by noise alone; one from elsewhere does not repeat it."""
    moved = RigidTransform.of([0.003, 0, 0], [0.1, 0.2, 0])
    poses = [RigidTransform.identity(), moved, steps(2)[1]]
    views = look(surface, poses, [POSE] * 3)
    warnings = calibrate(views.maps, views.rig(), QUICK).solution.warnings
    said = [w for w in warnings if "no more information than one" in w]
    assert len(said) == 1
    assert "view0 and view1" in said[0]


def test_sizes_differ(views: Views) -> None:
    maps = views.with_map(1, views.maps[1].q[:-3].astype(np.float64)).maps
    with pytest.raises(InputError, match="view1: map: the map is 108 x 81 pixels"):
        calibrate(maps, views.rig())


def test_all_frames_are_garbage(views: Views) -> None:
    maps = views.with_map(0, garbage("random", views)).with_map(1, garbage("smooth", views)).maps
    with pytest.raises(InputError, match="view"):
        calibrate(maps[:2], views.rig())
    empty = views.with_map(0, garbage("empty", views)).with_map(1, garbage("empty", views)).maps
    with pytest.raises(InputError, match="view0: map: the map has 0 usable"):
        calibrate(empty[:2], views.rig())


def test_contradictory_plan(views: Views) -> None:
    """One surface needs camera poses; they are fixed and nowhere given."""
    with pytest.raises(InputError, match="camera poses, which are fixed") as caught:
        calibrate(views.maps, views.rig(share={"camera_pose": "fixed"}))
    assert caught.value.where == "share.camera_pose"


def test_scales_of_their_own(views: Views) -> None:
    """Neither surface nor projector pose is shared: one baseline is applied to all, and said."""
    rig = views.rig(share={"surface": "per_frame", "projector_pose": "per_frame"})
    warnings = calibrate(views.maps[:2], rig, QUICK).solution.warnings
    assert any("a scale of their own" in w for w in warnings)
