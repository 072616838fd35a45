"""The same withdrawal tracked, calibrated jointly, and solved frame by frame and registered."""

from functools import partial
from time import process_time

from mitsuba_endo.evaluate.sequence_metrics import SequenceMetrics
from scripts.sequence_baselines import METHODS, MOST, errors
from tests.sequences import withdrawal

from .report import Figure

FRAMES, STEP = 40, 1.0
"""Of the way, and mm from one to the next: as many as solving each alone bears."""
HALF = 0.5

_figure = partial(Figure, "sequence")


def run(quick: bool) -> list[Figure]:
    """Compare trajectory and surface of three ways with the truth, and the first with the last."""
    recording = withdrawal(6 if quick else FRAMES, step=STEP)
    figures: list[Figure] = []
    found: dict[str, SequenceMetrics] = {}
    for name, method in METHODS.items():
        began = process_time()
        found[name] = errors(method(recording), recording)
        figures += _figures(name, found[name], process_time() - began)
    ours, other = found["sequence"], found["frame by frame, registered"]
    return [
        *figures,
        _ratio("trajectory", ours.ate_aligned_rms_mm, other.ate_aligned_rms_mm),
        _ratio("surface", ours.surface_rms_mm, other.surface_rms_mm),
    ]


def _figures(name: str, m: SequenceMetrics, seconds: float) -> list[Figure]:
    named = f"beside: {name}" + (f", {MOST} frames" if name.startswith("calibrate") else "")
    return [
        _figure(f"{named}: frames placed", m.frames - m.lost, "", "higher"),
        _figure(f"{named}: trajectory, aligned", m.ate_aligned_rms_mm, "mm RMS", "lower"),
        _figure(f"{named}: surface", _known(m.surface_rms_mm), "mm RMS", "lower"),
        _figure(f"{named}: seen surface found within 1 mm", _known(m.completeness_percent), "%",
                "higher"),
        _figure(f"{named}: processor time", seconds, "s", "lower"),
    ]  # fmt: skip


def _ratio(what: str, ours: float | None, other: float | None) -> Figure:
    name = f"beside: our {what} error / that of frames solved alone"
    return _figure(name, _known(ours) / _known(other), "ratio", "lower", HALF)


def _known(value: float | None) -> float:
    return float("nan") if value is None else value
