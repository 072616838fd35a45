"""Stopping and going on. Oracle: the optimum of the same calibration in one go."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from mitsuba_endo import backend
from mitsuba_endo.errors import InputError
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.records.solution import Outcome, load_solution
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.cli.inputs import run
from tests.solve.views import FOCAL, POSE, Views, look, projector_poses, relief_surface, steps

pytestmark = pytest.mark.usefixtures("llvm")

QUICK = Options(jackknife=False, check_model=False)
SHARES = {
    "one surface": {},
    "surfaces per frame": {"surface": "per_frame", "projector_pose": "shared"},
}


@pytest.fixture(scope="module", params=SHARES)
def case(request: pytest.FixtureRequest) -> tuple[Views, Rig, Calibration]:
    """Views, a rig, and the calibration in one go."""
    backend.ensure()  # fixtures of a module come before those of a function
    own = request.param == "one surface"
    views = look(relief_surface(), steps(2), projector_poses(2) if own else [POSE] * 2)
    rig = views.rig(share=SHARES[request.param])
    return views, rig, calibrate(views.maps, rig, QUICK)


def stop_at(iteration: int) -> Callable[[float, str], None]:
    """Return a progress callback that acts as Ctrl-C in an iteration of the last stage."""

    def progress(_share: float, step: str) -> None:
        if f"iteration {iteration}," in step:
            raise KeyboardInterrupt

    return progress


def checkpoint_of(result: Calibration) -> Checkpoint:
    assert result.checkpoint is not None
    return result.checkpoint


def assert_same_optimum(found: Calibration, oracle: Calibration) -> None:
    """Both stopped where a step is 0.1 standard deviations over all unknowns: single ones more, but
    nothing by more than 0.02 % of the focal length or 0.02 mm."""
    a, b = found.solution, oracle.solution
    assert a.outcome is Outcome.CONVERGED
    assert [f.name for f in a.frames] == [f.name for f in b.frames]
    std = b.projector.focal.std
    assert isinstance(std, float)
    limit = min(0.5 * std, 2e-4 * FOCAL)
    assert a.projector.focal.value == pytest.approx(b.projector.focal.value, abs=limit)
    for mine, other in zip(a.frames, b.frames, strict=True):
        for one, two in (
            (mine.projector_from_camera, other.projector_from_camera),
            (mine.world_from_camera, other.world_from_camera),
        ):
            assert one.t is not None
            assert two.t is not None
            assert two.std is not None
            limits = np.minimum(0.5 * np.array(two.std[3:]), 0.02) + 1e-9
            assert (np.abs(np.subtract(one.t, two.t)) <= limits).all()


def test_after_the_limit_of_iterations(case: tuple[Views, Rig, Calibration]) -> None:
    views, rig, oracle = case
    stopped = calibrate(views.maps, rig, replace(QUICK, max_iterations=1))
    assert stopped.solution.outcome is Outcome.MAX_ITERATIONS
    assert any("had not converged" in w for w in stopped.solution.warnings)
    assert len(stopped.trace) == 1
    assert_same_optimum(calibrate(views.maps, rig, QUICK, resume=checkpoint_of(stopped)), oracle)


def test_after_an_interrupt(case: tuple[Views, Rig, Calibration]) -> None:
    views, rig, oracle = case
    stopped = calibrate(views.maps, rig, QUICK, stop_at(1))
    assert stopped.solution.outcome is Outcome.INTERRUPTED
    assert_same_optimum(calibrate(views.maps, rig, QUICK, resume=checkpoint_of(stopped)), oracle)


def test_an_optimum_stays_where_it_is(case: tuple[Views, Rig, Calibration]) -> None:
    views, rig, oracle = case
    again = calibrate(views.maps, rig, QUICK, resume=checkpoint_of(oracle))
    assert_same_optimum(again, oracle)
    assert len(again.trace) <= 2


def test_interrupt_before_there_is_anything_to_keep(
    case: tuple[Views, Rig, Calibration],
) -> None:
    views, rig, _ = case

    def progress(_share: float, step: str) -> None:
        if step == "Searching for a start":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        calibrate(views.maps, rig, QUICK, progress)


def test_through_a_file(case: tuple[Views, Rig, Calibration], tmp_path: Path) -> None:
    """Oracle: the checkpoint in memory, field by field."""
    before = checkpoint_of(case[2])
    save_checkpoint(tmp_path / "state.npz", before)
    after = load_checkpoint(tmp_path)
    assert (after.law, after.names) == (before.law, before.names)
    assert after.last_stage is before.last_stage is True
    for a, b in zip(after.used, before.used, strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(after.surfaces, before.surfaces, strict=True):
        assert (a.kind, a.weight, a.disparity) == (b.kind, b.weight, b.disparity)
        np.testing.assert_array_equal(a.values, b.values)
        assert a.arrays.keys() == b.arrays.keys()
        for name in b.arrays:
            np.testing.assert_array_equal(a.arrays[name], b.arrays[name], err_msg=name)
    assert list(after.values) == list(before.values)
    for name in before.values:
        for a, b in zip(after.values[name], before.values[name], strict=True):
            np.testing.assert_array_equal(a, b, err_msg=name)


def test_law_that_was_being_fitted_is_kept() -> None:
    """Interrupted in the first of both laws: that one is returned and gone on with."""
    views = look(relief_surface(), steps(1), [POSE])
    rig = views.rig(projector={**views.rig().projector.model_dump(), "law": "auto"})
    stopped = calibrate(views.maps, rig, QUICK, stop_at(1))
    assert stopped.solution.outcome is Outcome.INTERRUPTED
    resumed = calibrate(views.maps, rig, QUICK, resume=checkpoint_of(stopped)).solution
    assert resumed.projector.law == stopped.solution.projector.law


def test_other_maps_are_refused(case: tuple[Views, Rig, Calibration]) -> None:
    views, rig, oracle = case
    checkpoint = checkpoint_of(oracle)
    with pytest.raises(InputError, match="view1: a frame of the earlier calibration is missing"):
        calibrate(views.maps[:1], rig, QUICK, resume=checkpoint)
    holes = views.maps[1].q.copy()
    holes[20:50] = np.nan
    with pytest.raises(InputError, match="view1: is not the map of the earlier calibration"):
        calibrate(views.with_map(1, holes).maps, rig, QUICK, resume=checkpoint)


def test_another_plan_is_refused(case: tuple[Views, Rig, Calibration]) -> None:
    views, rig, oracle = case
    surface = "shared" if rig.share.surface == "per_frame" else "per_frame"
    other = rig.model_copy(update={"share": rig.share.model_copy(update={"surface": surface})})
    with pytest.raises(InputError, match=r"share\.surface"):
        calibrate(views.maps, other, QUICK, resume=checkpoint_of(oracle))


@pytest.mark.parametrize(
    ("part", "change", "words"),
    [
        ("projector", {"law": "direction_cosine"}, "with pinhole, not direction_cosine"),
        ("projector", {"width": 530}, "another camera or size of the pattern"),
        ("camera", {"distortion": [-0.2, 0.05]}, "another camera or size of the pattern"),
        ("camera", {"K": [[90.0, 0, 50], [0, 90, 40], [0, 0, 1]]}, "another camera"),
    ],
)
def test_another_rig_is_refused(
    case: tuple[Views, Rig, Calibration], part: str, change: dict[str, Any], words: str
) -> None:
    """Another law was passed over, and another camera led elsewhere than a calibration anew."""
    views, rig, oracle = case
    data = rig.model_dump(mode="json")
    other = Rig.model_validate(data | {part: data[part] | change})
    with pytest.raises(InputError, match=words):
        calibrate(views.maps, other, QUICK, resume=checkpoint_of(oracle))


def test_another_scale_or_a_value_that_is_known_may_be_given(
    case: tuple[Views, Rig, Calibration],
) -> None:
    """Oracle: the lengths by hand; the focal length that was given."""
    views, rig, oracle = case
    data = rig.model_dump(mode="json")
    data["scale"] = {"baseline": 2 * views.baseline}
    data["projector"]["focal"] = {"value": FOCAL, "refine": False}
    data["projector"]["law"] = "auto"
    found = calibrate(views.maps, Rig.model_validate(data), QUICK, resume=checkpoint_of(oracle))
    assert found.solution.projector.focal.value == FOCAL
    assert found.solution.projector.focal.status == "fixed"
    t = found.solution.frames[0].projector_from_camera.t
    assert t is not None
    assert np.linalg.norm(t) == pytest.approx(2 * views.baseline, rel=1e-3)


def test_a_lattice_is_not_gone_on_with_as_a_mesh(case: tuple[Views, Rig, Calibration]) -> None:
    views, rig, oracle = case
    with pytest.raises(InputError, match="surface: the earlier calibration has no mesh"):
        calibrate(views.maps, rig, replace(QUICK, surface="mesh"), resume=checkpoint_of(oracle))


def test_a_mesh_is_gone_on_with() -> None:
    """Oracle: the optimum resumed from and its faces, whether a mesh is asked for or not."""
    views = look(relief_surface(), steps(2), projector_poses(2), width=72)
    first = calibrate(views.maps, views.rig(), replace(QUICK, surface="mesh"))
    for options in (QUICK, replace(QUICK, surface="mesh")):
        second = calibrate(views.maps, views.rig(), options, resume=checkpoint_of(first))
        assert_same_optimum(second, first)
        (a,), (b,) = (checkpoint_of(c).surfaces for c in (first, second))
        assert b.kind == "mesh"
        np.testing.assert_array_equal(a.arrays["faces"], b.arrays["faces"])


def test_command_goes_on_from_a_folder(tmp_path: Path) -> None:
    """Oracle: the folder resumed from, which had converged."""
    views = look(relief_surface(), steps(2), projector_poses(2))
    rig = views.rig().model_dump(mode="json", exclude={"drift"})
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig), encoding="utf-8")
    paths = []
    for map_ in views.maps:
        paths.append(tmp_path / f"{map_.name}.npz")
        np.savez(paths[-1], map=map_.q)
    common = ["calibrate", *paths, "--rig", tmp_path / "rig.yaml", "--quiet"]
    assert run(*common, "--out", tmp_path / "first").exit_code == 0
    result = run(*common, "--out", tmp_path / "second", "--resume", tmp_path / "first")
    assert result.exit_code == 0, result.stderr
    first, second = (load_solution(tmp_path / name) for name in ("first", "second"))
    assert second.projector.focal.value == pytest.approx(first.projector.focal.value, rel=1e-4)
    assert "registration" not in second.timings
    (tmp_path / "empty").mkdir()
    missing = run(*common, "--out", tmp_path / "third", "--resume", tmp_path / "empty")
    assert missing.exit_code == 2
    assert "state.npz" in missing.stderr


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.99])
def test_a_file_that_is_cut_off(
    case: tuple[Views, Rig, Calibration], tmp_path: Path, kept: float
) -> None:
    path = tmp_path / "state.npz"
    save_checkpoint(path, checkpoint_of(case[2]))
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    with pytest.raises(InputError, match=r"state\.npz: is not a readable checkpoint"):
        load_checkpoint(tmp_path)


@pytest.mark.parametrize("number", [None, 99])
def test_a_file_of_another_version(
    case: tuple[Views, Rig, Calibration], tmp_path: Path, number: int | None
) -> None:
    """Version 0.1 wrote no number; a later version may write another one."""
    path = tmp_path / "state.npz"
    save_checkpoint(path, checkpoint_of(case[2]))
    with np.load(path) as data:
        arrays = {name: data[name] for name in data if name != "format"}
    np.savez(path, **arrays, **({} if number is None else {"format": np.array(number)}))
    with pytest.raises(InputError, match=r"another version") as caught:
        load_checkpoint(tmp_path)
    assert "without --resume" in caught.value.todo
