"""Wrong models: whether a calibration notices, names the cause and widens its intervals.

Small scenes, each draw with its own rig, surfaces, noise and outliers. Seeds from 5000 on judge;
others were used while thresholds were chosen. ``python -m scripts.model_error_study`` runs more
draws, in pieces.
"""

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.records.solution import INTERVAL, PoseEstimate, Solution
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

from .model_error_scenes import KINDS, Kind, draw, given, right_setting, rigs
from .report import Figure

NAME = "model_error"
RIGHT = "right"
SEED = 5000
_figure = partial(Figure, NAME)
_RIGHT, _WRONG = 40, 5
"""Draws of the right model, and of each wrong one."""
_FIRST = 2
"""The right candidate, or one of its group, must be among so many."""
_LARGE = 5
"""A group of more than this names nothing."""
_UNWARNED = 3.0


@dataclass(frozen=True)
class Drawn:
    """What one draw led to."""

    kind: str
    seed: int
    refused: bool = False
    """Whether the input was refused, with the reason."""
    warned_before: bool = False
    """Whether a warning about the camera matrix came before solving."""
    suspected: bool = False
    unchecked: bool = False
    """Whether it is said that something given cannot be checked, though nothing is suspected."""
    named: bool = False
    first: str = ""
    """Key of the first candidate."""
    group: int = 0
    """Members of its group beside it."""
    deviations: list[float] = field(default_factory=list)
    """Errors of focal length and pose, in stated standard deviations."""
    wider: float = 1.0
    """Stated deviation of the focal length over that without the check."""
    slower: float = 1.0
    """CPU time over that without the check."""

    @property
    def noticed(self) -> bool:
        return self.refused or self.warned_before or self.suspected

    @property
    def record(self) -> dict[str, object]:
        return asdict(self)


def run(quick: bool) -> list[Figure]:
    """Calibrate right and wrong models."""
    drawn = [one(RIGHT, SEED + k) for k in range(2 if quick else _RIGHT)]
    for kind in list(KINDS)[:2] if quick else KINDS:
        drawn += [one(kind, SEED + 100 + k) for k in range(1 if quick else _WRONG)]
    return figures(drawn)


def one(kind: str, seed: int) -> Drawn:
    """Draw a rig, say something wrong of it or nothing, and calibrate with the check and without.

    Two runs, so that widths and times are compared on the same draw.
    """
    frames, rig = _said(kind, seed)
    try:
        checked, seconds = _calibrated(frames, rig, check=True)
        plain, without = _calibrated(frames, rig, check=False)
    except InputError:
        return Drawn(kind, seed, refused=True)
    candidates = checked.model["candidates"]
    return Drawn(
        kind, seed,
        warned_before=any(w.startswith("camera.K") for w in checked.warnings),
        suspected=checked.model["suspected"], unchecked=bool(checked.model["unchecked"]),
        named=kind != RIGHT and _named(checked, KINDS[kind]),
        first=candidates[0]["key"] if candidates else "",
        group=len(candidates[0]["group"]) if candidates else 0,
        deviations=_deviations(checked, frames[0]),
        wider=_std(checked) / _std(plain), slower=seconds / without,
    )  # fmt: skip


def solution_of(kind: str, seed: int) -> tuple[Solution, float]:
    """Return what a draw's calibration says, and the true focal length, pattern pixels."""
    solution, truth = solution_and_truth(kind, seed)
    return solution, float(truth.projector.focal)


def solution_and_truth(kind: str, seed: int) -> tuple[Solution, rigs.Rig]:
    """Return what a draw's calibration says, and its first frame as it was drawn."""
    frames, rig = _said(kind, seed)
    return _calibrated(frames, rig, check=True)[0], frames[0]


def _said(kind: str, seed: int) -> tuple[list[rigs.Rig], dict[str, object]]:
    """Return a draw, and the rig file in which something of it is wrong."""
    setting = right_setting(seed) if kind == RIGHT else KINDS[kind].setting
    frames = draw(seed, setting)
    rig = given(frames, setting.law)
    if kind != RIGHT:
        KINDS[kind].change(rig)
    return frames, rig


def _calibrated(
    frames: Sequence[rigs.Rig], rig: dict[str, object], *, check: bool
) -> tuple[Solution, float]:
    """Return the solution and the CPU seconds that it took."""
    maps = [CorrespondenceMap(f.q.astype(np.float32), f"{k}") for k, f in enumerate(frames)]
    began = time.process_time()
    found = calibrate(maps, Rig.model_validate(rig), Options(check_model=check)).solution
    return found, time.process_time() - began


def _std(solution: Solution) -> float:
    std = solution.projector.focal.std
    return std if isinstance(std, float) else 1.0


def _deviations(solution: Solution, truth: rigs.Rig) -> list[float]:
    """Return absolute errors over stated deviations, of what has a value."""
    out, focal = [], solution.projector.focal
    if isinstance(focal.value, float) and isinstance(focal.std, float):
        out.append(abs(focal.value - float(truth.projector.focal)) / focal.std)
    return [*out, *_of_pose(solution.frames[0].projector_from_camera, truth)]


def _of_pose(estimate: PoseEstimate, truth: rigs.Rig) -> list[float]:
    pose, true = estimate.to_transform(), truth.projector_from_camera
    if pose is None or estimate.std is None:
        return []
    turned = Rotation.from_matrix(pose.R @ true.R.T).as_rotvec()
    error, std = np.concatenate([turned, pose.t - true.t]), np.array(estimate.std)
    return [float(x) for x in np.abs(error[std > 0]) / std[std > 0]]


def _named(solution: Solution, kind: Kind) -> bool:
    """Tell whether the right candidate, or one of whose group it is, is among the first two."""
    model = solution.model
    plan = [f"plan.{p['block']}" for p in model["plan"] if p["refuted"]]
    keys = plan + [c["key"] for c in model["candidates"][:_FIRST]]
    keys += [key for c in model["candidates"][:_FIRST] if len(c["group"]) <= _LARGE
             for key in c["group_keys"]]  # fmt: skip
    return any(key.startswith(kind.names) or key == kind.whole for key in keys)


def figures(drawn: Sequence[Drawn]) -> list[Figure]:
    """Return the figures of every kind that was drawn."""
    out = []
    for kind in (RIGHT, *KINDS):
        of_kind = [d for d in drawn if d.kind == kind]
        if of_kind:
            out += _right(of_kind) if kind == RIGHT else _wrong(kind, of_kind)
    return [*out, *_times(drawn)]


def _right(drawn: Sequence[Drawn]) -> list[Figure]:
    inside = [x < INTERVAL for d in drawn for x in d.deviations]
    focal = [d.deviations[0] < INTERVAL for d in drawn if d.deviations]
    wider = [d.wider for d in drawn]
    return [
        _figure("right: draws", len(drawn), "", ""),
        _figure("right: false alarms", _percent([d.suspected for d in drawn]), "%", "lower", 2),
        _figure("right: told that a given value cannot be checked",
                _percent([d.unchecked for d in drawn]), "%", ""),
        _figure("right: focal length inside 95 %", _percent(focal), "%", "higher", 93),
        _figure("right: focal length and pose inside 95 %", _percent(inside), "%", "higher", 93),
        _figure("right: width of intervals over that without the check, mean",
                float(np.mean(wider)), "", "lower", 1.15),
        _figure("right: the same, worst", max(wider), "", "lower"),
    ]  # fmt: skip


def _wrong(kind: str, drawn: Sequence[Drawn]) -> list[Figure]:
    """Return shares of detected and named; a refusal or warning of the input is both."""
    noticed = [d.noticed for d in drawn]
    named = [d.named or d.refused or d.warned_before for d in drawn]
    beyond = [max(d.deviations, default=0.0) > _UNWARNED for d in drawn]
    unwarned = [b and not (n or d.unchecked)
                for b, n, d in zip(beyond, noticed, drawn, strict=True)]  # fmt: skip
    return [
        _figure(f"{kind}: detected, {len(drawn)} draws", _percent(noticed), "%", "higher", 99),
        _figure(f"{kind}: first or second named", _percent(named), "%", "higher", 90),
        _figure(
            f"{kind}: told that a value cannot be checked",
            _percent([d.unchecked for d in drawn]),
            "%",
            "",
        ),
        _figure(f"{kind}: unwarned beyond 3 deviations", sum(unwarned), "", "lower", 0),
        _figure(f"{kind}: beyond 3 deviations at all", _percent(beyond), "%", "lower"),
    ]


def _times(drawn: Sequence[Drawn]) -> list[Figure]:
    right = [d.slower for d in drawn if d.kind == RIGHT]
    wrong = [d.slower for d in drawn if d.kind != RIGHT and not d.refused]
    title = "CPU time over that without the check, median"
    return [
        _figure(f"{title}, {name}", float(np.median(of)), "", "lower", 1.3)
        for name, of in (("right", right), ("wrong", wrong))
        if of
    ]


def _percent(held: Sequence[bool]) -> float:
    return 100 * float(np.mean(held))
