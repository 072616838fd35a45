"""The unit of length."""

from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.solve.reporting.scale import Unit, resolve_unit
from tests.solve.problems import POSE, SHEET, rig_file, small_rig

RIG = small_rig("pinhole")
RANGES = [np.full((80, 96), np.nan), RIG.depth / RIG.baseline]


def unit_of(scale: dict[str, Any]) -> Unit:
    return resolve_unit(rig_file(RIG, scale=scale), RIG.camera, RANGES)


def test_baseline():
    """Oracle: its own length and relative standard deviation."""
    unit = unit_of({"baseline": 6.2, "baseline_std": 0.031})
    assert (unit.factor, unit.kind, unit.name) == (6.2, "baseline", "mm")
    assert unit.std_relative == pytest.approx(0.005)


def test_known_distance():
    """Oracle: the distance of the two true points in mm gives back the true baseline."""
    pixels = [[30.5, 20.25], [70.0, 60.75]]
    rays = RIG.camera.rays(np.array(pixels))
    ends = rays * SHEET(rays)[:, None]
    distance = {"pixels": pixels, "mm": float(np.linalg.norm(ends[0] - ends[1])), "std": 0.3,
                "frame": 1}  # fmt: skip
    unit = unit_of({"known_distance": distance})
    # Bilinear interpolation of a sheet curved over 30 px: 1e-3.
    assert unit.factor == pytest.approx(RIG.baseline, rel=1e-3)
    assert unit.std_relative == pytest.approx(0.3 / distance["mm"])
    assert (unit.kind, unit.name) == ("known_distance", "mm")


def test_up_to_scale():
    """Oracle: nothing is known, nothing is changed."""
    unit = unit_of({})
    assert (unit.factor, unit.kind, unit.name, unit.std_relative) == (
        1.0, "up_to_scale", "baseline", 0.0,
    )  # fmt: skip


def test_distance_between_points_that_were_not_seen():
    """Oracle: an InputError that names the field."""
    known = {"pixels": [[30.0, 20.0], [70.0, 60.0]], "mm": 10.0, "frame": 0}
    with pytest.raises(InputError) as caught:
        unit_of({"known_distance": known})
    assert caught.value.where == "scale.known_distance.pixels"


def test_poses_change_their_length_only():
    """Oracle: R as it was, t times the factor."""
    pose = Unit(2.5, "baseline", 0.0).pose(POSE)
    np.testing.assert_array_equal(pose.R, POSE.R)
    np.testing.assert_allclose(pose.t, 2.5 * POSE.t)
