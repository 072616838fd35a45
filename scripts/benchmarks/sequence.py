"""A video's worth of frames, tracked one after the other: a colon withdrawal and a stomach pan."""

import resource
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.evaluate.metric_value import root_mean_square
from mitsuba_endo.evaluate.trajectory_errors import (
    absolute_trajectory_error,
    relative_pose_error,
    trajectory_alignment,
)
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.solution import INTERVAL
from mitsuba_endo.records.trajectory import FrameRow
from mitsuba_endo.sequence.frames import Incoming, Unread
from mitsuba_endo.sequence.outcome import SequenceResult, outcome_of
from mitsuba_endo.sequence.run import run_sequence
from mitsuba_endo.show.sequence_folder import write_sequence_folder
from tests.lumen import FOCAL
from tests.sequences import Recording, pan, withdrawal

from .report import Figure

NAME = "sequence"
Floats = NDArray[np.float64]

WRONG = 2.0
"""mm: a placed frame farther from the truth than this, after the alignment, is silently wrong."""
NEAR = 1.0
"""mm within which the true surface counts as found."""
SAMPLED = 10
"""Every so many frames the points that were seen are compared with the surface."""
POINTS = 400
WINDOW = 100
"""Frames over which the scale is compared with the truth."""
DRAWS = 3
"""Short sequences of either kind, each with its own motion and noise: the first frame's errors are
in all poses alike, so that intervals of one sequence say little."""
NOTHING = range(25, 35)
"""Frames of which nothing is decoded, in the sequence with a gap."""


@dataclass
class Feed:
    """Makes maps when they are asked for, and keeps the time that takes apart."""

    recording: Recording
    nothing: range = range(0)
    seconds: float = 0.0
    memory: list[float] = field(default_factory=list)
    """Peak memory so far, MB, before each frame."""

    def frames(self) -> Iterator[Incoming]:
        for k in range(len(self.recording)):
            began = perf_counter()
            map_: Incoming = self._map(k)
            self.memory.append(_peak())
            self.seconds += perf_counter() - began
            yield map_

    def _map(self, k: int) -> Incoming:
        if k in self.nothing:
            return Unread(f"frame{k:04d}", "nothing is decoded")
        map_ = self.recording.map(k)
        return CorrespondenceMap(map_.q, map_.name)


def run(quick: bool) -> list[Figure]:
    """Track, write, and compare with the truth."""
    width, height = (160, 120) if quick else (320, 240)
    colon = withdrawal(40 if quick else 300, width=width, height=height)
    stomach = pan(40 if quick else 200, width=width, height=height)
    gap = withdrawal(60, seed=1)
    figures = _figures("colon", *_tracked(colon), colon)
    figures += _figures("stomach", *_tracked(stomach), stomach)
    result, _, _ = _tracked(gap, NOTHING)
    resumed = [row for row in result.rows if row.number not in NOTHING]
    return [
        *figures,
        *_short(1 if quick else DRAWS),
        _figure("gap of 10 frames: frames lost after it", _lost(resumed), "", "lower", 0),
        _figure("gap of 10 frames: silently wrong", _wrong(result, gap), "", "lower", 0),
    ]


_figure = partial(Figure, NAME)


def _short(draws: int) -> list[Figure]:
    """Return how often intervals hold the truth in short sequences."""
    held = []
    for seed in range(draws):
        for make in (withdrawal, pan):
            truth = make(60, seed=seed)
            rows = outcome_of(run_sequence(truth.maps(), truth.rig())).rows
            inside = [_within(row, truth) for row in rows if row.camera_std is not None]
            held.append(np.mean(inside, axis=0).reshape(2, 6).mean(1))
    shares = 100 * np.array(held).T
    named = zip(("camera", "projector"), shares, strict=True)
    return [
        figure
        for what, share in named
        for figure in (
            _figure(f"short: 95 % intervals of {what} poses that hold the truth", share.mean(), "%",
                    "higher", 85),
            _figure(f"short: the same, worst sequence of {share.size}", share.min(), "%", "higher"),
        )
    ]  # fmt: skip


def _tracked(recording: Recording, nothing: range = range(0)) -> tuple[SequenceResult, float, Feed]:
    """Return what was found, the seconds it took, files included, and the frames' feed."""
    feed, began = Feed(recording, nothing), perf_counter()
    result = outcome_of(run_sequence(feed.frames(), recording.rig()))
    with tempfile.TemporaryDirectory() as folder:
        write_sequence_folder(Path(folder) / "out", result)
    return result, perf_counter() - began - feed.seconds, feed


def _figures(
    what: str, result: SequenceResult, seconds: float, feed: Feed, truth: Recording
) -> list[Figure]:
    rows = [row for row in result.rows if not row.lost]
    found, true = _poses(rows, truth)
    rigid = trajectory_alignment(found, true, "rigid")
    aligned, plain = (
        root_mean_square(absolute_trajectory_error(found, true, by))
        for by in (rigid, trajectory_alignment(found, true, "none"))
    )
    focal = result.solution.projector.focal
    shift, turn = relative_pose_error(found, true, 10)
    figure = partial(_named, what)
    count = len(result.rows)
    return [
        figure("frames", count, "", ""),
        figure("frames lost", 100 * _lost(result.rows) / count, "%", "lower", 2),
        figure("silently wrong", _wrong(result, truth), "", "lower", 0),
        figure("absolute trajectory error, aligned", aligned, "mm RMS", "lower", 0.3),
        figure("absolute trajectory error, first cameras put together", plain, "mm RMS", "lower"),
        figure("error of motions over 10 frames", root_mean_square(shift), "mm RMS", "lower"),
        figure("error of turns over 10 frames", np.degrees(root_mean_square(turn)), "degrees RMS",
               "lower"),
        figure("scale of the way", _scale(found, true), "%", "lower", 0.3),
        figure(f"scale, worst of {WINDOW} frames", _worst_scale(found, true), "%", "lower", 0.3),
        figure("focal length", _focal_error(focal.value), "%", "lower", 0.1),
        figure("loop: first against last frame", _loop(found, true), "mm", "lower", 0.3),
        *_surface_figures(figure, result, truth, rigid),
        *_intervals(figure, rows, truth),
        figure("rate, files included", count / seconds, "frames/s", "higher", 3),
        figure("peak memory", _peak() / 1000, "GB", "lower", 1.2),
        figure("memory growth in the second half", _growth(feed.memory), "MB/frame", "lower", 1),
    ]  # fmt: skip


def _named(what: str, name: str, *rest: object) -> Figure:
    return _figure(f"{what}: {name}", *rest)  # type: ignore[arg-type]


def _surface_figures(
    figure: "partial[Figure]", result: SequenceResult, truth: Recording, rigid: object
) -> list[Figure]:
    surface = result.surfaces[result.main]
    assert surface is not None
    rng = np.random.default_rng(0)
    chosen = rng.choice(len(surface.vertices), min(20_000, len(surface.vertices)), replace=False)
    moved = rigid.apply(surface.vertices)  # type: ignore[attr-defined]
    mesh = truth.mesh
    error, plain = (
        distance_to_mesh(v[chosen], mesh.vertices, mesh.faces) for v in (moved, surface.vertices)
    )
    held = 100 * float((plain < INTERVAL * surface.std[chosen]).mean())
    seen = _seen_points(truth, rng)
    near = distance_to_mesh(seen, moved, surface.faces) <= NEAR
    return [
        figure("surface", root_mean_square(error), "mm RMS", "lower", 0.25),
        figure("surface, first cameras put together", root_mean_square(plain), "mm RMS", "lower"),
        figure(f"seen surface found within {NEAR:g} mm", 100 * float(near.mean()), "%", "higher",
               90),
        figure("95 % intervals of vertices that hold the truth", held, "%", "higher", 85),
    ]  # fmt: skip


def _seen_points(truth: Recording, rng: np.random.Generator) -> Floats:
    """Return points (N, 3) of the true surface that some frame's camera saw lit, world."""
    points = []
    for k in range(0, len(truth), SAMPLED):
        q, at = truth.exact(k)
        lit = at[np.isfinite(q).all(-1)]
        points.append(truth.world_from_camera[k].apply(lit[rng.integers(len(lit), size=POINTS)]))
    return np.concatenate(points)


def _intervals(figure: "partial[Figure]", rows: list[FrameRow], truth: Recording) -> list[Figure]:
    held = np.array([_within(row, truth) for row in rows if row.camera_std is not None])
    camera, projector = 100 * held[:, :6].mean(), 100 * held[:, 6:].mean()
    return [
        figure("95 % intervals of camera poses that hold the truth", camera, "%", "higher", 85),
        figure("95 % intervals of projector poses that hold the truth", projector, "%", "higher",
               85),
    ]  # fmt: skip


def _within(row: FrameRow, truth: Recording) -> NDArray[np.bool_]:
    """Tell of camera (6) and projector (6) which intervals hold the truth."""
    pairs = (
        (row.world_from_camera, truth.world_from_camera[row.number], row.camera_std),
        (row.projector_from_camera, truth.projector_from_camera[row.number], row.projector_std),
    )
    inside = []
    for pose, true, std in pairs:
        assert pose is not None
        assert std is not None
        turned = Rotation.from_matrix(pose.R @ true.R.T).as_rotvec()
        inside.append(np.abs(np.concatenate([turned, pose.t - true.t])) < INTERVAL * std)
    return np.concatenate(inside)


def _poses(
    rows: list[FrameRow], truth: Recording
) -> tuple[list[RigidTransform], list[RigidTransform]]:
    found = [row.world_from_camera for row in rows if row.world_from_camera is not None]
    return found, [truth.world_from_camera[row.number] for row in rows]


def _lost(rows: list[FrameRow]) -> int:
    return sum(bool(row.lost) for row in rows)


def _wrong(result: SequenceResult, truth: Recording) -> int:
    found, true = _poses([row for row in result.rows if not row.lost], truth)
    aligned = trajectory_alignment(found, true, "rigid")
    return int((absolute_trajectory_error(found, true, aligned) > WRONG).sum())


def _scale(found: list[RigidTransform], true: list[RigidTransform]) -> float:
    return 100 * abs(trajectory_alignment(found, true, "similarity").scale - 1)


def _worst_scale(found: list[RigidTransform], true: list[RigidTransform]) -> float:
    starts = range(0, max(len(found) - WINDOW, 0) + 1, WINDOW // 2)
    return max(_scale(found[k : k + WINDOW], true[k : k + WINDOW]) for k in starts)


def _loop(found: list[RigidTransform], true: list[RigidTransform]) -> float:
    shift, _ = relative_pose_error(found, true, len(found) - 1)
    return float(shift[0])


def _focal_error(value: object) -> float:
    return 100 * abs(value / FOCAL - 1) if isinstance(value, float) else float("inf")


def _peak() -> float:
    """Return the peak memory of this process, MB (Linux counts in kB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _growth(memory: list[float]) -> float:
    half = len(memory) // 2
    return (memory[-1] - memory[half]) / max(len(memory) - 1 - half, 1)
