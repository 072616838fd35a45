"""What the sharing plan promises, whatever the order of the files: every mode with every other."""

from itertools import combinations, product

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform, angle_between, rotation_angle
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.unknowns.block import BLOCKS
from mitsuba_endo.solve.unknowns.layout import make_layout
from tests.range_scenes import random_relief
from tests.rigs import with_noise
from tests.solve.problems import PROJECTION_MODELS, map_of, rig_file, small_rig
from tests.solve.views import POSE, Views, focal_error, look, projector_poses

pytestmark = pytest.mark.usefixtures("llvm")
QUICK = Options(jackknife=False, check_model=False)
OWN = {"surface": "per_frame", "projector_pose": "per_frame"}


@pytest.fixture(scope="module")
def unrelated() -> Views:
    """Two surfaces of little relief, each with a projector pose of its own."""
    rng = np.random.default_rng(8)
    surfaces = [random_relief(rng, 2.0), random_relief(rng, 1.2)]
    poses = projector_poses(2, seed=5)
    return look(surfaces, [RigidTransform.identity()] * 2, poses, noise=0.3)


def test_shared_focal_length_is_one_value(unrelated: Views) -> None:
    """Oracle: the order of the files changes nothing beyond the steps' tolerance."""
    rig = unrelated.rig(share=OWN)
    values = []
    for maps in (unrelated.maps, unrelated.maps[::-1]):
        solution = calibrate(list(maps), rig, QUICK).solution
        focal = solution.projector.focal
        assert isinstance(focal.value, float)
        assert isinstance(focal.std, float)
        assert abs(focal_error(solution)) < 2e-2
        assert all(f.focal is None for f in solution.frames)
        values.append((focal.value, focal.std))
    (first, std), (second, _) = values
    assert first == pytest.approx(second, abs=min(0.2 * std, 1e-3 * first))


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_fixed_focal_length_is_held(law: str) -> None:
    """Oracle: the value given, also where it says that it may be refined; the pose is fitted to it.

    It is 5 % too long, and a search would find another.
    """
    rig = with_noise(small_rig(law), 0.1, 0)
    given = rig_file(
        rig, projector={"focal": {"value": 346.5, "refine": True}}, share={"focal": "fixed"}
    )
    found = calibrate([map_of(rig)], given, QUICK).solution
    assert found.projector.focal.value == 346.5
    assert found.projector.focal.status == "fixed"
    assert found.noise_px is not None
    assert found.noise_px > 0.15, "a wrong focal length must show"


@pytest.mark.parametrize("focal", [None, 330.0])
def test_fixed_pose_is_held(focal: float | None) -> None:
    """Oracle: the pose given, to rounding, with and without a focal length; f within 1 %."""
    rig = with_noise(small_rig("direction_cosine"), 0.1, 0)
    R, t = rig.projector_from_camera.R, rig.projector_from_camera.t
    projector = {"pose": {"R": R.tolist(), "t": t.tolist()}}
    if focal is not None:
        projector["focal"] = {"value": focal, "refine": True}
    given = rig_file(rig, projector=projector, share={"projector_pose": "fixed"})
    found = calibrate([map_of(rig)], given, QUICK).solution
    pose = found.frames[0].projector_from_camera
    assert pose.status == "fixed"
    np.testing.assert_allclose(pose.R, R, atol=1e-12)
    np.testing.assert_allclose(pose.t, t, rtol=1e-9)
    assert isinstance(found.projector.focal.value, float)
    assert found.projector.focal.value == pytest.approx(330.0, rel=1e-2)


def test_pose_without_focal_length_is_where_to_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: no search is made, and the optimum is that of a search."""
    rig = with_noise(small_rig("pinhole"), 0.1, 0)
    searched = calibrate([map_of(rig)], rig_file(rig), QUICK).solution
    turned = rig.projector_from_camera.perturbed(np.array([0.01, -0.01, 0.01, 0.1, 0.1, -0.1]))
    pose = {"R": turned.R.tolist(), "t": turned.t.tolist()}
    given = rig_file(rig, projector={"pose": pose})
    monkeypatch.setattr("mitsuba_endo.solve.frames.initial_poses.search_start", None)
    found = calibrate([map_of(rig)], given, QUICK).solution
    std = found.projector.focal.std
    assert isinstance(std, float)
    limit = min(std, 1e-3 * rig.projector.focal)
    assert found.projector.focal.value == pytest.approx(searched.projector.focal.value, abs=limit)
    a, b = (s.frames[0].projector_from_camera.to_transform() for s in (found, searched))
    assert a is not None
    assert b is not None
    assert rotation_angle(a.R @ b.R.T) < 1e-3
    assert angle_between(a.t, b.t) < 1e-3


MODES = ("fixed", "shared", "per_frame")


@pytest.mark.parametrize(
    ("pose", "focal", "centre", "distortion"), list(product(MODES, MODES, MODES, MODES))
)
def test_every_pair_of_modes(pose: str, focal: str, centre: str, distortion: str) -> None:
    """Oracle: a value is one where it is shared or fixed, and what is fixed is what was given.

    Random steps of the unknowns move every value that is an unknown and no other.
    """
    rig = small_rig("pinhole")
    projector = {
        "focal": {"value": 331.0, "refine": True},
        "pose": {"R": POSE.R.tolist(), "t": POSE.t.tolist()},
        "centre": [251.0, 204.0],
        "distortion": [0.01, -0.02],
    }
    share = {"projector_pose": pose, "focal": focal, "centre": centre, "distortion": distortion}
    record = rig_file(rig, projector=projector, share={"surface": "per_frame", **share})
    layout = make_layout(record, 3)
    rng = np.random.default_rng(0)
    state = layout.state(
        [np.ones(3)] * 3,
        {
            "projector_pose": [POSE.perturbed(rng.normal(0, 0.01, 6)) for _ in range(3)],
            "focal": [np.log([v]) for v in (320.0, 330.0, 345.0)],
        },
    )
    moved = layout.retract(state, rng.normal(0, 0.01, layout.columns))
    for name, mode in share.items():
        block, given = BLOCKS[name], layout.given[name]
        steps = [np.abs(block.difference(given, moved.at(name, k))).max() for k in range(3)]
        if mode == "fixed":
            assert max(steps) < 1e-12
        else:
            assert min(steps) > 0
            assert (len(set(steps)) == 1) is (mode == "shared")


SHARED = [name for name in BLOCKS if name != "camera_pose"]


@pytest.mark.parametrize(("one", "other"), list(combinations(SHARED, 2)))
def test_every_pair_of_blocks(one: str, other: str) -> None:
    """Oracle: as above, for every two kinds of unknown in all their modes, the camera's included.

    The other blocks are fixed, so a column that belongs to a third would show.
    """
    rig = small_rig("pinhole")
    projector = {
        "focal": {"value": 331.0, "refine": True},
        "pose": {"R": POSE.R.tolist(), "t": POSE.t.tolist()},
        "distortion": [0.01, -0.02],
    }
    camera = Camera.from_model(rig.camera).model_copy(update={"distortion": [0.01, -0.02]})
    rng = np.random.default_rng(0)
    for modes in product(BLOCKS[one].modes, BLOCKS[other].modes):
        share = dict.fromkeys(SHARED, "fixed") | dict(zip((one, other), modes, strict=True))
        record = rig_file(
            rig, projector=projector, camera=camera, share={"surface": "per_frame", **share}
        )
        layout = make_layout(record, 3)
        state = layout.state([np.ones(3)] * 3, {})
        moved = layout.retract(state, rng.normal(0, 0.01, layout.columns))
        for name, mode in share.items():
            before = [state.at(name, k) for k in range(3)]
            steps = [
                np.abs(BLOCKS[name].difference(before[k], moved.at(name, k))).max()
                for k in range(3)
            ]
            if mode == "fixed":
                assert max(steps) < 1e-12, name
            else:
                assert min(steps) > 0, name
                assert (len(set(steps)) == 1) is (mode == "shared"), name
