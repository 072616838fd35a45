"""Through a sequence, frame by frame."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ..errors import InputError
from ..geometry.cameras import CameraModel
from ..geometry.transforms import RigidTransform
from ..interrupts import uninterrupted
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from ..records.trajectory import FrameRow
from ..sanity.examine import examine
from ..sanity.finding import Finding
from .bootstrap import Beginning, begin, check_plan
from .epipolar_focal import FocalSum, focal_of, told_of_focal
from .frames import Incoming, Unread, check_enough, check_size, shortage, without_missing
from .keeper import Keeper
from .kept_maps import KeptMaps
from .options import SequenceOptions
from .part import Part, Tracked
from .view import ThinnedMap, thinned, thinning, view_of

LONG_LOSS = 15
"""Frames in a row that show enough and fit nowhere, after which a new part begins."""

EARLY = "it comes before the first frame that could be calibrated"

OnFrame = Callable[[FrameRow], None]
"""Called with every frame, in order, once it is placed or lost."""


@dataclass(eq=False)
class Recorded:
    """What is known after some frames of a sequence."""

    rig: Rig
    rows: list[FrameRow]
    """One a frame, in order."""
    parts: list[Part] = field(default_factory=list)
    """Maps that do not hang together, in the order in which they began."""
    beginning: Beginning | None = None
    kept: list[KeptMaps] = field(default_factory=list)
    """Maps of some keyframes of each part."""
    told: FocalSum = field(default_factory=FocalSum)
    """What all placed frames told of the focal length, about the value that was held."""
    findings: dict[str, str] = field(default_factory=dict)
    """Of each likely mistake in what was given the first warning."""
    interrupted: bool = False
    seconds: dict[str, float] = field(default_factory=dict)
    """Wall-clock time by stage."""


class Run:
    """A sequence under way: frames come in by :meth:`add`."""

    def __init__(self, rig: Rig, options: SequenceOptions, on_frame: OnFrame | None = None) -> None:
        """Look at the rig.

        Raises:
            InputError: it asks for what a sequence cannot do.
        """
        check_plan(rig)
        self.recorded = Recorded(rig, [])
        self._options, self._on_frame = options, on_frame or (lambda _row: None)
        full = rig.camera.to_model()
        self._step = thinning(full)
        self._camera: CameraModel = thinned(full, self._step)
        self._waiting: list[tuple[Unread | ThinnedMap, Incoming]] = []
        """Frames before the first ones are calibrated, and what they were made of."""
        self._missed = 0
        """Frames in a row that were lost although they show enough."""
        self._names: set[str] = set()

    @classmethod
    def resumed(cls, state: Mapping[str, Any], on_frame: OnFrame | None = None) -> "Run":
        """Return the run that :meth:`state` was taken of, ready for the next frame."""
        run = cls.__new__(cls)
        vars(run).update(state)
        run._on_frame = on_frame or (lambda _row: None)
        run.recorded.interrupted = False
        run._drain()
        return run

    @property
    def taken(self) -> int:
        """Frames that were recorded or wait to be."""
        return len(self.recorded.rows) + len(self._waiting)

    def state(self) -> dict[str, Any]:
        """Return all that the next frames depend on, as it is now."""
        return {name: value for name, value in vars(self).items() if name != "_on_frame"}

    def add(self, frame: Incoming) -> None:
        """Take the next frame. Ctrl-C is felt between frames, never in the middle of one.

        Raises:
            InputError: its size is not the rig's, its name came before, or the first frames tell
                no calibration.
        """
        if frame.name in self._names:
            raise InputError("two frames have this name", frame.name, "rename one file")
        frame, view = self._viewed(frame)
        with uninterrupted():
            self._names.add(frame.name)
            self._waiting.append((view, frame))
        if self.recorded.beginning is not None:
            self._drain()
        elif sum(isinstance(v, ThinnedMap) for v, _ in self._waiting) >= self._options.first:
            self._begin()

    def end(self) -> Recorded:
        """Return what was recorded; frames that still wait are begun with.

        Raises:
            InputError: nothing can be calibrated.
        """
        if self.recorded.beginning is None:
            self._begin()
        return self.recorded

    def _viewed(self, frame: Incoming) -> tuple[Incoming, Unread | ThinnedMap]:
        """Return a frame without what stands for missing, and as it is tracked."""
        if isinstance(frame, Unread):
            return frame, frame
        check_size(frame, self.recorded.rig)
        frame, findings = without_missing(frame)
        self._warn(findings)
        view = view_of(frame, self._camera, self._step)
        reason = shortage(view)
        return frame, Unread(frame.name, reason) if reason else view

    def _warn(self, findings: Iterable[Finding]) -> None:
        for finding in findings:
            self.recorded.findings.setdefault(finding.kind, finding.warning)

    def _begin(self) -> None:
        """Calibrate the frames that wait, and record them."""
        began = time.perf_counter()
        views = [v for v, _ in self._waiting if isinstance(v, ThinnedMap)]
        maps = [
            m for v, m in self._waiting if isinstance(v, ThinnedMap) and not isinstance(m, Unread)
        ]
        check_enough([v for v, _ in self._waiting])
        beginning = begin(maps, views, self.recorded.rig, self._options)
        self._warn(examine([maps[beginning.first]], self.recorded.rig).findings)
        self.recorded.seconds["beginning"] = time.perf_counter() - began
        self._waiting = _without_early(self._waiting, views[beginning.first])
        self.recorded.beginning = beginning
        self._drain()

    def _drain(self) -> None:
        """Record the frames that wait, each one wholly or not at all."""
        while self._waiting and self.recorded.beginning is not None:
            with uninterrupted():
                self._record(*self._waiting[0])
                del self._waiting[0]
            self._on_frame(self.recorded.rows[-1])

    def _record(self, view: Unread | ThinnedMap, frame: Incoming) -> None:
        """Place a frame and keep what is known of it."""
        began = time.perf_counter()
        number = len(self.recorded.rows)
        outcome = view.reason if isinstance(view, Unread) else self._placed(number, view)
        part = max(len(self.recorded.parts) - 1, 0)
        row = FrameRow(number, view.name, part=part)
        row = replace(row, lost=outcome) if isinstance(outcome, str) else _row(row, outcome)
        row = replace(row, seconds=time.perf_counter() - began)
        if row.keyframe and isinstance(frame, CorrespondenceMap):
            self.recorded.kept[part].offer(number, frame)
        self.recorded.rows.append(row)

    def _placed(self, number: int, view: ThinnedMap) -> Tracked | str:
        parts, beginning = self.recorded.parts, self.recorded.beginning
        assert beginning is not None
        if not parts:
            part = Part(beginning.setup, number, view, beginning.projector_pose, beginning.noise)
            self._append(part)
            return part.first
        outcome = parts[-1].track(number, view)
        if not isinstance(outcome, str):
            self._missed = 0
            self._tell_focal(outcome)
            return outcome
        self._missed += 1
        return self._new_part(number, view) if self._missed > LONG_LOSS else outcome

    def _tell_focal(self, tracked: Tracked) -> None:
        if tracked.placement is not None:
            pose, noise = tracked.poses.projector_from_camera, tracked.placement.noise
            told = told_of_focal(tracked.placement.triangulated, pose, noise)
            self.recorded.told = self.recorded.told.plus(*told)

    def _new_part(self, number: int, view: ThinnedMap) -> Tracked:
        """Begin a new map with a frame that fits nowhere on the old one."""
        beginning = self.recorded.beginning
        assert beginning is not None
        last = next(r for r in reversed(self.recorded.rows) if r.projector_from_camera is not None)
        pose: RigidTransform | None = last.projector_from_camera
        assert pose is not None
        if not beginning.setup.drift.held:
            pose = focal_of([view], beginning.setup.projector, pose, free=False).poses[0]
        part = Part(beginning.setup, number, view, pose, self.recorded.parts[-1].noise)
        self._append(part)
        return part.first

    def _append(self, part: Part) -> None:
        self.recorded.parts.append(part)
        self.recorded.kept.append(KeptMaps())
        self._missed = 0


_Waiting = list[tuple[Unread | ThinnedMap, Incoming]]


def _without_early(waiting: _Waiting, first: ThinnedMap) -> _Waiting:
    """Return the frames with those before the first one to be placed marked as lost."""
    at = next(k for k, (view, _) in enumerate(waiting) if view is first)
    early = [
        (Unread(view.name, EARLY) if isinstance(view, ThinnedMap) else view, frame)
        for view, frame in waiting[:at]
    ]
    return early + waiting[at:]


def _row(row: FrameRow, tracked: Tracked) -> FrameRow:
    std, placement = np.sqrt(np.diag(tracked.covariance)), tracked.placement
    row = replace(
        row, keyframe=tracked.keyframe, world_from_camera=tracked.poses.world_from_camera,
        projector_from_camera=tracked.poses.projector_from_camera,
    )  # fmt: skip
    if placement is None:
        return row
    return replace(
        row, projector_std=std[:6], camera_std=std[6:], noise_px=placement.noise,
        misfit=placement.misfit, overlap=placement.overlap, agreement=placement.agreement,
    )  # fmt: skip


def run_sequence(
    frames: Iterable[Incoming],
    rig: Rig,
    options: SequenceOptions | None = None,
    on_frame: OnFrame | None = None,
    *,
    run: Run | None = None,
    keeper: Keeper | None = None,
) -> Recorded:
    """Track all frames of a sequence.

    Frames are taken one by one, and what is kept of them are their poses, packed coordinates for
    the adjustment, and what they add to the map. Ctrl-C ends the sequence after the frames that
    were placed.

    Args:
        frames: correspondence maps in the order in which they were taken.
        rig: what is known.
        options: how to go through them.
        on_frame: called with every frame once it is placed or lost.
        run: to go on with, after :meth:`Run.resumed`; it has its own rig, options, ``on_frame``.
        keeper: told of every frame.

    Returns:
        Poses and maps, the unit of length of the rig's scale; the world is the first camera.

    Raises:
        InputError: frames or rig that cannot be used; says what to do.
        KeyboardInterrupt: stopped before the first frames were calibrated.
    """
    run = run or Run(rig, options or SequenceOptions(), on_frame)
    # One thread: the matrices are too small for two, which then wait for each other.
    with threadpool_limits(1, "blas"):
        try:
            for frame in frames:
                run.add(frame)
                if keeper is not None:
                    keeper.after_frame(run)
        except KeyboardInterrupt:
            if not run.recorded.parts:
                raise
            run.recorded.interrupted = True
        recorded = run.end()
        if keeper is not None:
            keeper.at_end(run)
        return recorded
