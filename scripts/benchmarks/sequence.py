"""A video's worth of frames, tracked one after the other: a colon withdrawal and a stomach pan."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from mitsuba_endo.evaluate.sequence_errors import evaluate_sequence
from mitsuba_endo.evaluate.sequence_metrics import SequenceMetrics
from mitsuba_endo.evaluate.tracked_frames import TrackedFrames
from mitsuba_endo.records.trajectory import FrameRow
from mitsuba_endo.sequence.run import LONG_LOSS
from tests.sequences import Recording, pan, withdrawal

from . import sequence_beside, sequence_photographs
from .report import Figure, in_own_process
from .sequence_run import SequenceRun, errors, run_frames, run_recording

NAME = "sequence"

WRONG = 2.0
"""mm: a placed frame farther from the truth than this, after the alignment, is silently wrong."""
DRAWS = 3
"""Short sequences of either kind, each with its own motion and noise: the first frame's errors are
in all poses alike, so that intervals of one sequence say little."""
NOTHING = range(25, 35)
"""Frames of which nothing is decoded, in the sequence with a gap."""
JUMP = 30
"""Frames in either of the two places of the sequence that jumps."""

_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Run all parts, each in a process of its own, whose memory nothing else has touched."""
    return [figure for part in PARTS for figure in in_own_process(f"{NAME}/{part}", quick=quick)]


def colon(quick: bool) -> list[Figure]:
    """A withdrawal over 150 mm."""
    return _whole("colon", _way(withdrawal, 300, quick=quick))


def stomach(quick: bool) -> list[Figure]:
    """A pan that ends where it began."""
    return _whole("stomach", _way(pan, 200, quick=quick))


def gap(_quick: bool) -> list[Figure]:
    """Ten frames show nothing."""
    truth = withdrawal(60, seed=1)
    found = run_recording(truth, NOTHING)
    after = [row for row in found.rows if row.number not in NOTHING]
    return [
        _figure("gap of 10 frames: frames lost after it", _lost(after), "", "lower", 0),
        _figure("gap of 10 frames: largest error of a placed frame",
                errors(found, truth).ate_aligned_max_mm, "mm", "lower", WRONG),
    ]  # fmt: skip


def jump(_quick: bool) -> list[Figure]:
    """From one frame to the next the camera is in another colon."""
    first, second = withdrawal(JUMP, seed=1), withdrawal(JUMP, seed=2)
    maps = [*first.maps(), *(replace(m, name=f"other_{m.name}") for m in second.maps())]
    found = run_frames(maps, first.rig())
    parts = max(row.part for row in found.rows if not row.lost) + 1
    said = any(f"falls into {parts} parts" in line for line in found.result.solution.verdict)
    rows = [row for row in found.rows if row.number < JUMP]
    before = TrackedFrames(found.result.solution, rows, None)
    late = sum(bool(row.lost) for row in found.rows if row.number >= JUMP)
    return [
        _figure("jump to another place: two parts, told in the verdict", parts == 2 and said, "",
                "higher", 1),
        _figure("jump to another place: frames lost before the new part begins", late, "", "lower",
                LONG_LOSS),
        _figure("jump to another place: largest error of a frame before it",
                evaluate_sequence(before, first.truth, None).ate_aligned_max_mm, "mm", "lower",
                WRONG),
    ]  # fmt: skip


def long(quick: bool) -> list[Figure]:
    """A thousand frames of 160 x 120 pixels: time and memory."""
    truth = withdrawal(60 if quick else 1000)
    found = run_recording(truth)
    return [
        _figure("long: frames", len(found.rows), "", ""),
        *_tracking("long", errors(found, truth)),
        *_costs("long", found),
    ]


def short(quick: bool) -> list[Figure]:
    """Tell how often intervals hold the truth, over several short sequences."""
    held = []
    for seed in range(1 if quick else DRAWS):
        for make in (withdrawal, pan):
            truth = make(60, seed=seed)
            found = errors(run_recording(truth), truth)
            held.append((found.camera_intervals_percent, found.projector_intervals_percent))
    shares = np.array(held, float).T
    return [
        figure
        for what, share in zip(("camera", "projector"), shares, strict=True)
        for figure in (
            _figure(f"short: 95 % intervals of {what} poses that hold the truth", share.mean(), "%",
                    "higher", 85),
            _figure(f"short: the same, worst sequence of {share.size}", share.min(), "%", "higher"),
        )
    ]  # fmt: skip


def photographs(quick: bool) -> list[Figure]:
    """Path-traced photographs, decoded and refined."""
    found = sequence_photographs.tracked(6 if quick else 80)
    return _figures("photographs", found, sequence_photographs.compared(found),
                    sequence_photographs.TARGETS)  # fmt: skip


PARTS: dict[str, Callable[[bool], list[Figure]]] = {
    "colon": colon,
    "stomach": stomach,
    "gap": gap,
    "jump": jump,
    "long": long,
    "short": short,
    "photographs": photographs,
    "beside": sequence_beside.run,
}

TARGETS = {"lost": 2.0, "trajectory": 0.3, "surface": 0.25, "rate": 3.0}
"""Of sequences of maps."""


def _way(make: Callable[..., Recording], count: int, *, quick: bool) -> Recording:
    return make(40, width=160, height=120) if quick else make(count, width=320, height=240)


def _lost(rows: list[FrameRow]) -> int:
    return sum(bool(row.lost) for row in rows)


def _whole(what: str, truth: Recording) -> list[Figure]:
    found = run_recording(truth)
    return _figures(what, found, errors(found, truth), TARGETS)


def _figures(
    what: str, found: SequenceRun, m: SequenceMetrics, targets: dict[str, float]
) -> list[Figure]:
    named = partial(_named, what)
    return [
        named("frames", m.frames, "", ""),
        *_tracking(what, m, targets),
        named("trajectory, first cameras put together", m.ate_first_rms_mm, "mm RMS", "lower"),
        named("motions over 10 frames", m.rpe_shift_rms_mm, "mm RMS", "lower"),
        named("turns over 10 frames", m.rpe_turn_rms_deg, "degrees RMS", "lower"),
        named("scale of the way", _size_of(m.scale_error_percent), "%", "lower", 0.3),
        named("scale, worst of 100 frames", _size_of(m.scale_worst_percent), "%", "lower", 0.3),
        named("stated deviation of the scale", found.scale_std, "%", ""),
        named("focal length", _size_of(m.focal_error_percent), "%", "lower", 0.1),
        named("first against last frame", m.last_to_first_mm, "mm", "lower",
              0.3 if what == "stomach" else None),
        named("surface", m.surface_rms_mm, "mm RMS", "lower", targets["surface"]),
        named("surface, median", m.surface_median_mm, "mm", "lower"),
        named("seen surface found within 1 mm", m.completeness_percent, "%", "higher", 90),
        *(
            named(f"95 % intervals of {of} that hold the truth", share, "%", "higher", 85)
            for of, share in (
                ("camera poses", m.camera_intervals_percent),
                ("projector poses", m.projector_intervals_percent),
                ("vertices", m.vertex_intervals_percent),
            )
        ),
        *_costs(what, found, targets["rate"]),
    ]  # fmt: skip


def _tracking(what: str, m: SequenceMetrics, targets: dict[str, float] = TARGETS) -> list[Figure]:
    named = partial(_named, what)
    return [
        named("frames lost", 100 * m.lost / m.frames, "%", "lower", targets["lost"]),
        named("largest error of a placed frame", m.ate_aligned_max_mm, "mm", "lower", WRONG),
        named("trajectory, aligned", m.ate_aligned_rms_mm, "mm RMS", "lower",
              targets["trajectory"]),
    ]  # fmt: skip


def _costs(what: str, found: SequenceRun, rate: float = TARGETS["rate"]) -> list[Figure]:
    named, count = partial(_named, what), len(found.rows)
    return [
        named("rate, finish and files included", count / found.seconds, "frames/s", "higher", rate),
        named("processor time a frame, the same", found.processor / count, "s", "lower"),
        named("peak memory", found.peak / 1000, "GB", "lower", 1.2),
        named("memory growth in the second half", found.growth, "MB/frame", "lower", 1),
    ]  # fmt: skip


def _named(what: str, name: str, value: float | None, *rest: object) -> Figure:
    return _figure(f"{what}: {name}", float("nan") if value is None else value, *rest)  # type: ignore[arg-type]


def _size_of(value: float | None) -> float | None:
    return None if value is None else abs(value)
