"""Numbers that stand for "missing" are named and left out."""

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.sanity.examine import examine
from tests.sanity.given import map_of, noisy, record


@pytest.mark.parametrize("share", [0.03, 0.3, 0.6])
@pytest.mark.parametrize("value", [(0.0, 0.0), (-1.0, -1.0), (65535.0, 65535.0), (0.0, 399.0)])
def test_pair(value: tuple[float, float], share: float):
    """Oracle: exactly the pixels that were overwritten are gone, and the value is named."""
    rig = noisy(4)
    rng = np.random.default_rng(0)
    hit = rng.random(rig.q.shape[:2]) < share
    map_ = map_of(np.where(hit[..., None], value, rig.q))
    examined = examine([map_], record(rig))
    (finding,) = examined.findings
    assert finding.kind == "missing_value"
    assert f"hold ({value[0]:g}, {value[1]:g})" in examined.warnings[0]
    np.testing.assert_array_equal(examined.maps[0].valid, map_of(rig.q).valid & ~hit)


def test_one_coordinate():
    """Oracle: x alone missing in a tenth of the pixels, among whole numbers."""
    rig = noisy(4)
    hit = np.random.default_rng(0).random(rig.q.shape[:2]) < 0.1
    q = np.round(rig.q)
    q[hit, 0] = -1
    (warning,) = examine([map_of(q)], record(rig)).warnings
    assert "hold x = -1" in warning


def test_frames_are_told_together():
    """Oracle: five frames with the same sign make one sentence."""
    rig = noisy(4)
    q = rig.q.copy()
    q[:20] = 0
    maps = [map_of(q, f"{k}.exr") for k in range(5)]
    (warning,) = examine(maps, record(rig)).warnings
    assert warning.startswith("0.exr, 1.exr, 2.exr and 2 more: map: 18 % of the pixels")


def test_nothing_left():
    """Oracle: a map of zeros alone has no correspondence, and the zeros are said to be why."""
    with pytest.raises(InputError, match=r"0 usable correspondences.*likely cause.*\(0, 0\)"):
        examine([map_of(np.zeros((112, 160, 2)))], record(noisy(4)))
