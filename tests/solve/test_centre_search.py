"""The centre of a lens that nobody gave is found, refined, and said to be. Oracle: the truth."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from mitsuba_endo.backend import use
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.rig import Rig, load_rig
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from scripts.benchmarks.real_captures import CAPTURES, _rig
from tests import rigs
from tests.sanity.given import map_of, record

pytestmark = pytest.mark.usefixtures("llvm")
MIDDLE = (255.5, 199.5)
FIELD = Path(__file__).parents[3] / "shared" / "field" / "11_lens_shift_default_centre"
QUICK = Options(jackknife=False)


def _seen(height: float) -> rigs.Rig:
    """Return a rig whose projector's centre lies at a share of the pattern's height."""
    pose = RigidTransform.of([0.6 * (height - 0.5), -0.1, 0.04], [-6.0, 2.0, 1.5])
    projector = projector_model("pinhole", 600.0, (MIDDLE[0], height * 399))
    surface = rigs.bumpy_sheet(70, (0.2, -0.3), 7, 3)
    rig = rigs.cast(rigs.lopsided_camera(160, 112), projector, (512, 400), pose, surface)
    return rigs.with_noise(rig, 0.2, 1)


def _diffractive() -> rigs.Rig:
    """Return a rig whose projector is a diffractive element, its zero order in the middle."""
    rig = rigs.cast(
        rigs.lopsided_camera(160, 112), projector_model("direction_cosine", 330.0, MIDDLE),
        (512, 400), RigidTransform.of([0.05, -0.1, 0.04], [-6.0, 2.0, 1.5]),
        rigs.bumpy_sheet(70, (0.2, -0.3), 7, 3),
    )  # fmt: skip
    return rigs.with_noise(rig, 0.2, 1)


def _record(rig: rigs.Rig, mode: Literal["fixed", "shared"] | None = None, **more: object) -> Rig:
    given = record(rig, centre=None, **more)
    return given.model_copy(update={"share": given.share.model_copy(update={"centre": mode})})


@pytest.fixture(scope="module")
def shifted() -> tuple[rigs.Rig, Calibration]:
    use("llvm_ad_rgb")
    rig = _seen(1.07)
    return rig, calibrate([map_of(rig.q)], _record(rig), QUICK)


def test_found_and_refined(shifted: tuple[rigs.Rig, Calibration]):
    """Oracle: the rig; errors in standard deviations, which are capped."""
    rig, result = shifted
    s = result.solution
    assert s.outcome is Outcome.CONVERGED
    for estimate, truth, cap in (
        (s.projector.centre, rig.projector.centre, 15.0), (s.projector.focal, 600.0, 12.0)
    ):  # fmt: skip
        assert estimate.status in ("measured", "weak")
        error, std = np.subtract(estimate.value, truth), np.asarray(estimate.std)
        assert (np.abs(error) < 4 * std).all()
        assert (std < cap).all()
    (note,) = [w for w in s.warnings if w.startswith("projector.centre: not given")]
    assert "was found along the pattern's height" in note
    assert "from where it is refined" in note


def test_resumed_where_it_was(shifted: tuple[rigs.Rig, Calibration]):
    """Oracle: the calibration that is resumed; the centre found is not lost to the middle."""
    rig, before = shifted
    again = calibrate([map_of(rig.q)], _record(rig), QUICK, resume=before.checkpoint)
    assert again.solution.projector.centre.value == pytest.approx(
        before.solution.projector.centre.value, abs=0.1
    )
    assert any("the earlier calibration found another" in w for w in again.solution.warnings)


def test_kept_as_the_plan_asks():
    """Oracle: the plan. A centre that is fixed and not given is that of the search."""
    rig = _seen(1.07)
    s = calibrate([map_of(rig.q)], _record(rig, "fixed"), QUICK).solution
    assert s.projector.centre.status == "fixed"
    assert isinstance(s.projector.centre.value, list)
    assert s.projector.centre.value[1] == pytest.approx(rig.projector.centre[1], abs=6)
    assert any("is kept as the plan asks" in w for w in s.warnings)


@pytest.mark.parametrize("case", ["middle is right", "pose is given", "plane"])
def test_assumed_where_it_is_not_looked_for_or_right(case: str):
    """Oracle: only a lens whose start is searched for has another centre than the middle."""
    rig, options, more = _seen(0.5), QUICK, {}
    if case == "pose is given":
        pose = rig.projector_from_camera
        more = {"pose": {"R": pose.R.tolist(), "t": pose.t.tolist()}}
    if case == "plane":
        options = replace(QUICK, start="plane", plane_distance=70.0)
    s = calibrate([map_of(rig.q)], _record(rig, **more), options).solution
    assert s.projector.centre.value == pytest.approx(MIDDLE)
    assert any("assumed in the middle of the pattern, (255.5, 199.5)" in w for w in s.warnings)


def test_a_diffractive_element_is_not_doubted():
    """Oracle: its zero order is the middle of the pattern."""
    s = calibrate([map_of(_diffractive().q)], _record(_diffractive()), QUICK).solution
    assert s.projector.law == "direction_cosine"
    assert not any("projector.centre" in w for w in s.warnings)


@pytest.mark.slow
@pytest.mark.skipif(not Path(CAPTURES).is_dir(), reason="the real captures lie beside the project")
@pytest.mark.parametrize("frames", [[0], [1], [2], [3], [4], [0, 1, 2, 3, 4]])
@pytest.mark.parametrize("given", [True, False])
def test_real_captures_converge(frames: list[int], given: bool):
    """Oracle: a chessboard calibration. From the centre given and from none the free centre
    converges, singly and jointly, where version 0.1 ended at its limit of iterations."""
    paths = [CAPTURES / f"capture_{k}_small.npz" for k in frames]
    with np.load(paths[0]) as file:
        arrays = dict(file)
    rig = _rig(arrays)
    share = {"centre": "shared"} if given else {}
    if len(frames) > 1:
        share |= {"surface": "per_frame", "projector_pose": "shared"}
    projector = rig.projector if given else rig.projector.model_copy(update={"centre": None})
    rig = rig.model_copy(
        update={"projector": projector, "share": rig.share.model_copy(update=share)}
    )
    s = calibrate([load_map(p) for p in paths], rig).solution
    assert s.outcome is Outcome.CONVERGED
    assert isinstance(s.projector.focal.value, float)
    assert s.projector.focal.value == pytest.approx(arrays["K_proj"][0, 0], rel=0.01)
    assert np.abs(np.subtract(s.projector.centre.value, arrays["K_proj"][:2, 2])).max() < 40


def test_another_model_does_not_inherit_the_centre():
    """Oracle: the plan. Under ``auto`` a lens's centre is looked for and refined; the diffractive
    element, whose rig it is, keeps its own in the middle, and wins."""
    rig = _diffractive()
    s = calibrate([map_of(rig.q)], _record(rig, law="auto"), QUICK).solution
    assert s.projector.law == "direction_cosine"
    assert s.projector.centre.status == "fixed"
    assert s.projector.centre.value == pytest.approx(MIDDLE)
    assert s.projector.focal.value == pytest.approx(330.0, rel=0.01)


@pytest.mark.skipif(not FIELD.is_dir(), reason=f"{FIELD} is absent")
def test_a_stranger_s_shifted_lens():
    """Oracle: the rig with its centre, which lies below the pattern, beside the one without."""
    asked, given = (
        calibrate([load_map(FIELD / "map.exr")], load_rig(FIELD / name), QUICK).solution
        for name in ("asked.yaml", "rig.yaml")
    )
    centre = load_rig(FIELD / "rig.yaml").projector.centre
    assert centre is not None
    error = np.subtract(asked.projector.centre.value, centre)
    assert (np.abs(error) < 3 * np.asarray(asked.projector.centre.std)).all()
    assert np.abs(error).max() < 15
    assert asked.projector.focal.value == pytest.approx(given.projector.focal.value, rel=0.01)
