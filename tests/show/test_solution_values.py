"""The table of numbers: rounding, units, and which values are results."""

from collections.abc import Callable

import pytest

from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.show.solution_values import interval, rows


@pytest.mark.parametrize(
    ("value", "std", "shown"),
    [
        (1883.8790, 0.9996, ("1883.9", "± 2.0")), (0.25, 0.001, ("0.2500", "± 0.0020")),
        (-622.31, 130.0, ("-622", "± 255")), (3.25, None, ("3.25", "")), (3.25, 0.0, ("3.25", "")),
        (None, 1.0, ("not determined", "")),
    ],
)  # fmt: skip
def test_interval_has_two_digits(value: float | None, std: float | None, shown: tuple[str, str]):
    """Oracle: 1.96 standard deviations by hand."""
    assert interval(value, std) == shown


def test_rows_of_a_solution(make_calibration: Callable[..., Calibration]):
    """Oracle: the made-up pose, t = (-6, 1.4, 0.5) mm; one baseline a frame, the first given."""
    found = rows(make_calibration(width=64, height=46, count=2).solution)
    by_frame = {
        name: [r for r in found if r.group == name]
        for name in ("run/frame_0.exr", "run/frame_1.exr")
    }
    for name, status in (("run/frame_0.exr", "fixed"), ("run/frame_1.exr", "measured")):
        (baseline,) = [r for r in by_frame[name] if r.quantity == "baseline"]
        # The deviations of (-6, 1.4, 0.5) +- 0.01 mm each, as far as they allow: 0.0255 mm.
        shown = ("6.1814", "") if status == "fixed" else ("6.181", "± 0.025")
        assert (baseline.value, baseline.interval, baseline.unit) == (*shown, "mm")
        assert baseline.status == status
        (x,) = [r for r in by_frame[name] if r.quantity == "projector translation x"]
        assert (x.value, x.interval, x.unit) == ("-6.000", "± 0.020", "mm")
        (angle,) = [r for r in by_frame[name] if r.quantity == "projector rotation y"]
        assert (angle.value, angle.interval, angle.unit) == ("-6.303", "± 0.011", "deg")
    assert len({(r.group, r.quantity) for r in found}) == len(found)
