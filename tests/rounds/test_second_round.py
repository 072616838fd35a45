"""The second round of a calibration, on a synthetic view with exact geometry."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import angle_between
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale
from mitsuba_endo.records.solution import Outcome
from mitsuba_endo.refine.pattern_image import grid_image
from mitsuba_endo.refine.refine_map import refine_map
from mitsuba_endo.rounds.known_geometry import known_geometry
from mitsuba_endo.rounds.second_round import read_again, second_round
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.refine.scene_views import POSE, PROJECTOR, coordinates_of, geometry
from tests.refine.views import GRID, HEIGHT, PERIOD, WIDTH, photo, wrong_by

PATTERN = grid_image(GRID)
QUICK = Options(jackknife=False, check_model=False)
KNOWN = geometry()
TRUTH = coordinates_of(KNOWN)
HOLE = np.zeros((HEIGHT, WIDTH), bool)
HOLE[30:120, 90:180] = True


@dataclass(frozen=True, eq=False)
class Round:
    rig: Rig
    image: NDArray[np.integer]
    map: CorrespondenceMap
    first: Calibration

    @property
    def pictures(self) -> list[tuple[str, NDArray[np.integer]]]:
        return [("frame", self.image)]


@pytest.fixture
def one(llvm: str) -> Round:
    """A photograph whose decoder left a hole, refined and calibrated."""
    return _calibrated()


@cache
def _calibrated() -> Round:
    rig = Rig(
        camera=Camera.from_model(KNOWN.camera),
        projector=Projector(width=GRID.width, height=GRID.height, focal=Focal(value=330)),
        scale=Scale(baseline=float(np.linalg.norm(POSE.t))),
    )
    image = photo(TRUTH, speckle=0.2)
    q = np.where(HOLE[..., None], np.float32(np.nan), wrong_by(TRUTH, 0.2).q)
    map_ = refine_map(CorrespondenceMap(q, "frame"), image, PATTERN).map
    return Round(rig, image, map_, calibrate([map_], rig, QUICK))


def test_the_geometry_of_a_calibration(one: Round) -> None:
    """Oracle: the exact pair and ranges; a frame that the calibration does not know has none."""
    found = known_geometry(one.first.solution, one.first.camera, one.map)
    assert found is not None
    assert found.projector.focal == pytest.approx(PROJECTOR.focal, rel=0.02)
    assert np.degrees(angle_between(found.projector_from_camera.t, POSE.t)) < 3
    np.testing.assert_array_equal(np.isfinite(found.range), one.map.valid)
    ratio = (found.range / KNOWN.range)[one.map.valid]
    assert np.median(np.abs(ratio - 1)) < 0.05
    assert known_geometry(one.first.solution, one.first.camera, replace(one.map, name="b")) is None


def test_a_hole_is_read_and_calibrated(one: Round) -> None:
    """Oracle: the exact coordinates, and the calibration that the maps returned give."""
    read, second = second_round(one.first, [one.map], one.pictures, PATTERN, one.rig, QUICK)
    (map_,) = read.maps
    assert read.worth_solving
    assert read.change > 0.15
    assert map_.valid[HOLE].mean() > 0.9
    assert np.abs(map_.q - TRUTH)[map_.valid].max() < PERIOD / 2
    assert "pixels read that the decoder did not" in read.line()
    assert second is not one.first
    np.testing.assert_array_equal(second.frames[0].observed, map_.q)
    focal = second.solution.projector.focal.value
    assert isinstance(focal, float)
    assert focal == pytest.approx(PROJECTOR.focal, rel=0.01)


def test_a_mask_holds_in_the_second_round_too(one: Round) -> None:
    """Oracle: masked pixels, which the image would give, have no coordinate."""

    def masked(map_: CorrespondenceMap) -> CorrespondenceMap:
        return replace(map_, q=np.where(HOLE[..., None], np.float32(np.nan), map_.q))

    read, second = second_round(
        one.first, [one.map], one.pictures, PATTERN, one.rig, QUICK, masked=masked
    )
    assert not read.maps[0].valid[HOLE].any()
    assert not np.isfinite(second.frames[0].observed[HOLE]).any()


def test_where_nothing_changes_the_first_calibration_stays(one: Round) -> None:
    """Oracle: the very calibration; the map read once more gains nothing."""
    full = read_again(one.first, [one.map], one.pictures, PATTERN).maps[0]
    read, second = second_round(one.first, [full], one.pictures, PATTERN, one.rig, QUICK)
    assert read.change < 0.05
    assert second is one.first
    assert "too little to solve again" in read.line()


def test_what_did_not_converge_says_nothing(one: Round) -> None:
    """Oracle: the maps as they were."""
    stalled = one.first.solution.model_copy(update={"outcome": Outcome.STALLED})
    first = replace(one.first, solution=stalled)
    read, second = second_round(first, [one.map], one.pictures, PATTERN, one.rig, QUICK)
    assert read.maps == [one.map]
    assert second is first
    assert "nothing read anew" in read.line()


def test_pictures_of_other_frames_are_passed_over(one: Round) -> None:
    """Oracle: the maps as they were; a picture of another size is refused by the frame's name."""
    other = [("another", one.image)]
    assert read_again(one.first, [one.map], other, PATTERN).maps == [one.map]
    with pytest.raises(InputError, match="frame: the image is 190 x 150"):
        read_again(one.first, [one.map], [("frame", one.image[:, :190])], PATTERN)
