"""The laser grid."""

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.rendering.pattern import make_pattern


def test_lines_lie_where_the_period_says() -> None:
    """Oracle: lines at the middle plus whole periods, in pattern pixels."""
    image = make_pattern("grid", width="61", height="41", period="10", oversample="1")
    assert image.shape == (41, 61, 3)
    between = image[5, :, 1]  # a row half a period from the lines at 0, 10, 20
    peaks = np.flatnonzero((between[1:-1] > between[:-2]) & (between[1:-1] > between[2:])) + 1
    np.testing.assert_array_equal(peaks, [10, 20, 30, 40, 50])
    assert between[30] == pytest.approx(1)
    assert between[25] == pytest.approx(0.02, abs=1e-3)
    assert image[30, :, 1] == pytest.approx(1)  # a line along x


def test_oversampling_keeps_pattern_pixels() -> None:
    """Oracle: the mean over a pattern pixel's texels lies between its coarse neighbours."""
    fine = make_pattern("grid", width=60, height=40, period=10, oversample=4)
    assert fine.shape == (160, 240, 3)
    profile = fine[:, :, 1].min(0)
    position = (np.arange(240) + 0.5) / 4 - 0.5
    brightest = position[profile > 0.9]
    np.testing.assert_allclose(
        (brightest - 29.5) / 10, np.round((brightest - 29.5) / 10), atol=0.03
    )


@pytest.mark.parametrize(
    ("name", "settings", "named"),
    [
        ("gird", {}, "grid"),
        ("grid", {"perod": 3}, "perod"),
        ("grid", {"period": "wide"}, "period"),
        ("grid", {"line": 0}, "line"),
    ],
)
def test_mistakes_are_named(name: str, settings: dict, named: str) -> None:
    """The message names what is wrong or what there is."""
    with pytest.raises(InputError, match=named):
        make_pattern(name, **settings)
