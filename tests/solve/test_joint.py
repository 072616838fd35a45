"""Several frames solved together: sharing modes, starts, a lumen, drift. Oracle: the views' truth.

Limits are a few of the standard deviations that the solution states, capped by a physical one, so
that neither a large error nor a large stated deviation passes.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.range_scenes import Surface, bumpy_sheet, organ, random_relief
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


@pytest.fixture(scope="module")
def views(four_views: Views) -> Views:
    return four_views


def assert_right(
    views: Views, result: Calibration, *, focal: float = 2e-3, baseline: float = 5e-3
) -> None:
    """Everything is within its physical limit, and the focal length within 4 deviations."""
    solution = result.solution
    assert_near(views, solution, focal=focal, baseline=baseline)
    assert solution.left_out == []
    assert not any("do not rely" in w for w in solution.warnings)
    std = solution.projector.focal.std
    assert isinstance(std, float)
    assert abs(focal_error(solution)) * views.projector.focal < 4 * std
    for frame in solution.frames:
        error = frame_errors(views, frame)
        assert error.projector < 0.05, frame.name
        assert error.camera < 0.2, frame.name


def test_paper_mode(views: Views) -> None:
    """Surface shared, camera and projector poses per frame, focal length shared."""
    result = calibrate(views.maps, views.rig())
    assert_right(views, result)
    poses = [f.projector_from_camera.t for f in result.solution.frames]
    assert len({tuple(t) for t in poses if t}) == 4
    # Every frame's points are on the one surface: 0.1 px of noise is 0.15 mm at 70 mm.
    tree = cKDTree(result.surface.vertices)
    for at, points in zip(views.world_from_camera, views.points, strict=True):
        seen = points[np.isfinite(points[..., 0])]
        distance, nearest = tree.query(at.apply(seen))
        close = distance < 2  # the lattice's cells are 2 mm wide
        assert close.mean() > 0.7
        along = at.apply(seen)[close] - result.surface.vertices[nearest[close]]
        assert abs(np.median(along[:, 2])) < 0.1


def test_order_of_the_frames(four_views: Views) -> None:
    """Oracle: the same frames in another order, whose first is the world and the unit of length.

    The focal length agrees within a fifth of its deviation, which itself is capped; the baselines,
    over that of one frame, within a thousandth.
    """
    options = Options(jackknife=False, check_model=False)
    order = [2, 0, 3, 1]
    solutions = [
        calibrate([four_views.maps[k] for k in ks], four_views.rig(), options).solution
        for ks in (range(4), order)
    ]
    first, second = (s.projector.focal for s in solutions)
    assert isinstance(first.std, float)
    assert first.std < 2e-3 * four_views.projector.focal
    assert second.value == pytest.approx(first.value, abs=0.2 * first.std)
    baselines = [
        {f.name: np.linalg.norm(f.projector_from_camera.t or 0) for f in s.frames}
        for s in solutions
    ]
    for name in baselines[0]:
        one, other = (r[name] / r[four_views.maps[0].name] for r in baselines)
        assert other == pytest.approx(one, rel=1e-3)


def test_configuration_b(surface: Surface) -> None:
    """Surface and projector pose shared, camera poses per frame."""
    views = look(surface, steps(3), [POSE] * 3)
    result = calibrate(views.maps, views.rig(share={"projector_pose": "shared"}))
    assert_right(views, result)
    first, *others = (f.projector_from_camera for f in result.solution.frames)
    assert all(pose == first for pose in others)


def test_fixed_rig_over_unrelated_scenes(surface: Surface) -> None:
    """Surface per frame, projector pose and focal length shared, camera poses fixed."""
    rng = np.random.default_rng(3)
    surfaces = [surface, random_relief(rng, 2.5), bumpy_sheet(rng)]
    views = look(surfaces, [RigidTransform.identity()] * 3, [POSE] * 3)
    share = {"surface": "per_frame", "projector_pose": "shared"}
    result = calibrate(views.maps, views.rig(share=share))
    assert_right(views, result)
    assert {f.world_from_camera.status for f in result.solution.frames} == {"fixed"}
    for k, own in enumerate([result.surface, *result.own_surfaces.values()]):
        seen = views.points[k][np.isfinite(views.points[k][..., 0])]
        distance, _ = cKDTree(seen).query(own.vertices)
        assert np.median(distance) < 1.0, "half a cell: the frame's own surface, not another's"


def test_three_frames_know_more_than_one(views: Views) -> None:
    """Oracle: independent information adds up."""
    few, rig = views.maps[:3], views.rig()
    options = Options(jackknife=False, check_model=False)
    together = calibrate(few, rig, options).solution.projector.focal.std_formal
    alone = calibrate(few[:1], rig, options).solution.projector.focal.std_formal
    assert isinstance(together, float)
    assert isinstance(alone, float)
    assert together < alone / np.sqrt(2)


def test_identity_start(views: Views) -> None:
    """All cameras start at one place; the optimum is that of the registered start."""
    options = Options(cameras="identity", jackknife=False, check_model=False)
    result = calibrate(views.maps, views.rig(), options)
    registered = calibrate(views.maps, views.rig(), Options(jackknife=False, check_model=False))
    assert_right(views, result)
    value, other = (c.solution.projector.focal.value for c in (result, registered))
    assert value == pytest.approx(other, rel=2e-4)
    assert len(result.trace) > len(registered.trace)


def test_lumen() -> None:
    """A camera that moves along a colon and sees the wall all around.

    Behind a fold, the frames ahead see what one surface seen from the first camera cannot show.
    """
    rng = np.random.default_rng(2)
    poses = [RigidTransform.identity()]
    for z in (5.0, 10.0):
        aside = rng.normal(0, 1.5, 2)
        poses.append(RigidTransform.of(rng.normal(0, 0.05, 3), [*aside, z]))
    views = look(organ("colon", seed=5, behind=45.0, fold_depth=3.0), poses, projector_poses(3))
    result = calibrate(views.maps, views.rig(), Options(jackknife=False, check_model=False))
    solution = result.solution
    assert solution.outcome is Outcome.CONVERGED
    assert solution.left_out == []
    assert abs(focal_error(solution)) < 2e-3
    for frame in solution.frames:
        error = frame_errors(views, frame)
        assert abs(error.baseline) < 5e-3
        assert error.camera < 0.5
        assert error.position < 0.3
    # All around, and ahead of the first camera's sight of the near wall.
    angle = np.arctan2(result.surface.vertices[:, 1], result.surface.vertices[:, 0])
    assert np.histogram(angle, 8, (-np.pi, np.pi))[0].min() > 20


def test_unseen_vertices_are_left_out(views: Views) -> None:
    """Oracle: the map: no vertex of the surface lies in its hole or far outside the frames."""
    q = views.maps[0].q.copy()
    q[25:60, 40:75] = np.nan
    alone = calibrate(
        [replace(views.maps[0], q=q)], views.rig(), Options(jackknife=False, check_model=False)
    )
    uv = views.camera.project(alone.surface.vertices)
    inside = ((uv > [44, 29]) & (uv < [70, 55])).all(1)
    assert len(uv) > 300
    assert not inside.any()
    assert alone.surface.std is not None
    assert np.isfinite(alone.surface.std).all()


def test_other_frames_fill_the_hole(views: Views) -> None:
    """Oracle: the same hole, seen by three more frames."""
    q = views.maps[0].q.copy()
    q[25:60, 40:75] = np.nan
    maps = [replace(views.maps[0], q=q), *views.maps[1:]]
    result = calibrate(maps, views.rig(), Options(jackknife=False, check_model=False))
    uv = views.camera.project(result.surface.vertices)
    assert ((uv > [44, 29]) & (uv < [70, 55])).all(1).sum() > 30
    assert abs(focal_error(result.solution)) < 2e-3


def test_drift_lies_between_shared_and_independent(surface: Surface) -> None:
    """Oracle: a wide random walk is no prior, a narrow one is a shared pose."""
    views = look(surface, steps(3), [POSE] * 3, noise=0.5)
    drift = {"insertion_mm": 1.0, "lateral_mm": 1.0, "roll_deg": 1.0, "tilt_deg": 1.0}

    def spread(factor: float | None, **share: str) -> float:
        scaled = factor and {name: factor * value for name, value in drift.items()}
        rig = views.rig(share=share, **({"drift": scaled} if scaled else {}))
        solution = calibrate(views.maps, rig, Options(jackknife=False, check_model=False)).solution
        t = np.array([f.projector_from_camera.t for f in solution.frames])
        return float(np.linalg.norm(np.diff(t, axis=0)))

    free, wide, middle, narrow = (spread(f) for f in (None, 1e3, 1e-2, 1e-5))
    assert wide == pytest.approx(free, rel=0.05)
    assert 0.05 * free < middle < 0.95 * free
    assert narrow < 1e-3 * free
    assert spread(None, projector_pose="shared") == 0
