"""From a fit to the solution that is saved: units, standard deviations, verdicts."""

import platform
from dataclasses import asdict, dataclass
from importlib import metadata

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...records.calibration import Calibration
from ...records.history import scaled
from ...records.rig import Camera, Rig
from ...records.solution import (
    Alternative,
    Estimate,
    Frame,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
    Status,
)
from ...start.rivals import Rival
from ..fit import Fit
from ..optimise.rendered import USED_WEIGHT, Rendering, render_frames
from ..options import Options
from ..prepare.resume import checkpoint_of
from ..statistics.observability import (
    Direction,
    Unknown,
    advice,
    correlation,
    describe,
    free_directions,
    is_flat,
    status_of,
    unknowns,
)
from ..unknowns.plan import Plan
from ..unknowns.state import INTRINSICS
from .ambiguity import AMBIGUOUS, alternative, ambiguities
from .redundancy import Look, redundancy_warnings
from .scale import Unit, resolve_unit
from .slips import count_slips
from .surface_result import frame_maps, surface_estimate
from .verdict import verdict

UNSETTLED = "the optimisation had not converged"
"""Why a value with a small standard deviation is weak."""


@dataclass(frozen=True, eq=False)
class Report:
    """What the assembly of one fit needs at several places."""

    fit: Fit
    unit: Unit
    covariance: NDArray[np.float64]
    """(G, G): formal, scaled up to the jackknife where that is larger."""
    names: list[Unknown]
    directions: list[Direction]
    flat: bool
    rivals: list[tuple[list[int], Rival]]
    """Other projector poses that fit, with their frames."""

    @property
    def plan(self) -> Plan:
        return self.fit.problem.plan

    def status(self, slot: slice) -> Status:
        """Return the status of a block."""
        return _status(self.fit.optimum.outcome, self.covariance, self.names[slot], slot)

    def ambiguous(self, frame: int) -> bool:
        """Tell whether the residuals cannot choose between this frame's pose and another."""
        return any(frame in frames and not rival.decided for frames, rival in self.rivals)

    def reason(self, block: str, frame: int) -> str | None:
        """Say why a block is not measured, and what would help."""
        slot = self.plan.slot(block, frame)
        if slot is None:
            return None
        if _worst(self.covariance, self.names[slot], slot) == "measured":
            return UNSETTLED
        mine = {self.names[i].words(self.plan) for i in range(slot.start, slot.stop)}
        for direction in self.directions:
            if mine & set(direction.mixes):
                blocks = {n.block for n in self.names if n.words(self.plan) in direction.mixes}
                others = [m for m in direction.mixes if m not in mine]
                mixed = f"it cannot be separated from {_listed(others)}: " if others else ""
                return mixed + advice(blocks, self.fit.law, self.flat)
        return advice({block}, self.fit.law, self.flat)


def assemble(
    fit: Fit,
    camera: CameraModel,
    rig: Rig,
    options: Options,
    law_evidence: dict | None = None,
    warnings: list[str] | None = None,
) -> Calibration:
    """Build the calibration record of a fit.

    Raises:
        InputError: the scale cannot be resolved.
    """
    renderings = render_frames(fit.reported, camera)
    seen = {m.name: r.range for m, r in zip(fit.maps, renderings, strict=True)}
    unit = resolve_unit(rig, camera, [seen.get(name) for name in fit.given])
    report = _report(fit, unit)
    surfaces = [
        surface_estimate(fit, i, unit.factor, _inflation(fit))
        for i in range(fit.problem.plan.surfaces)
    ]
    period = rig.projector.grid_period
    slips = [
        None if period is None else count_slips(m.q, r.q, period)
        for m, r in zip(fit.maps, renderings, strict=True)
    ]
    solution = Solution(
        outcome=fit.optimum.outcome,
        units=unit.name,
        scale=unit.kind,
        scale_std_percent=100 * unit.std_relative,
        camera=Camera.from_model(camera),
        projector=_projector(report, rig),
        frames=[_frame(report, k, slips[k]) for k in range(len(fit.maps))],
        left_out=fit.left_out,
        alternatives=_alternatives(report),
        surface="surface.ply",
        noise_px=fit.uncertainty.sigma,
        law_evidence=law_evidence or {},
        observability={
            "before_optimising": describe(fit.foreseen),
            "free_directions": describe(report.directions),
            "correlation": correlation(report.covariance, report.names, report.plan),
        },
        timings=fit.timings,
        versions=versions(),
        configuration={"options": asdict(options), "rig": rig.model_dump(mode="json")},
        warnings=[
            *fit.notes,
            *(warnings or []),
            *_warnings(report),
            *redundancy_warnings(_looks(fit, camera, renderings), camera, fit.uncertainty.sigma),
        ],
    )
    solution = solution.model_copy(update={"verdict": verdict(solution)})
    return Calibration(
        solution, camera, surfaces[0], frame_maps(fit, renderings), fit.optimum.trace,
        checkpoint_of(fit.optimum), dict(enumerate(surfaces[1:], 1)),
        scaled(fit.history, unit.factor),
    )  # fmt: skip


def _report(fit: Fit, unit: Unit) -> Report:
    names = unknowns(fit.problem.plan, fit.state)
    covariance = _larger(fit)
    rho = fit.state.rho[0]
    points = fit.problem.surfaces[0].lattice.vertices(rho)
    determined = [
        all(
            slot is None
            or _status(fit.optimum.outcome, covariance, names[slot], slot) != "unobservable"
            for slot in (fit.problem.plan.slot(b, k) for b in ("projector_pose", "focal"))
        )
        for k in range(len(fit.maps))
    ]
    return Report(
        fit, unit, covariance, names,
        free_directions(covariance, names, fit.problem.plan), is_flat(points),
        ambiguities(fit, covariance, determined),
    )  # fmt: skip


def _alternatives(report: Report) -> list[Alternative]:
    fit = report.fit
    return [
        alternative(
            rival,
            [fit.maps[k].name for k in frames],
            report.unit.pose(fit.state.projector_from_camera[frames[0]]),
            float(_values(report, "focal", frames[0])[0]),
        )
        for frames, rival in report.rivals
    ]


def _variances(fit: Fit) -> list[NDArray[np.float64]]:
    """Return the variances (G,) of every jackknife that was computed."""
    known = fit.uncertainty
    return [np.diag(c) for c in (known.jackknife, known.frame_jackknife) if c is not None]


def _larger(fit: Fit) -> NDArray[np.float64]:
    """Return the formal covariance scaled so that no variance is below the jackknife's."""
    formal = fit.uncertainty.formal
    variance = np.diag(formal)
    largest = np.max([variance, *_variances(fit)], axis=0)
    root = np.sqrt(largest / np.maximum(variance, 1e-300))
    return formal * np.outer(root, root)


def _inflation(fit: Fit) -> float:
    """Return by how much the jackknife's standard deviations exceed the formal ones, at least 1."""
    formal = np.diag(fit.uncertainty.formal)
    ratios = [np.median(v / formal) for v in _variances(fit) if len(v)]
    return float(np.sqrt(max([1.0, *ratios])))


def _projector(report: Report, rig: Rig) -> ProjectorEstimate:
    projector = rig.projector
    shared = report.plan.blocks["focal"] != "per_frame"
    focal = (
        _intrinsic(report, "focal", 0)
        if shared
        else Estimate(
            value=None, status="unobservable", reason="it is per frame; see frames[].focal"
        )
    )
    return ProjectorEstimate(
        law=report.fit.law, width=projector.width, height=projector.height, focal=focal,
        centre=_intrinsic(report, "centre", 0), aspect=_intrinsic(report, "aspect", 0),
        distortion=_intrinsic(report, "distortion", 0),
    )  # fmt: skip


def _intrinsic(report: Report, block: str, frame: int) -> Estimate:
    """Return the estimate of an intrinsic block, null where the data do not determine it."""
    values = _values(report, block, frame)
    slot = report.plan.slot(block, frame)
    if slot is None:
        return Estimate(value=_plain(values, block), status="fixed")
    scale = values if block in ("focal", "aspect") else np.ones(len(values))
    formal, jackknife, largest = _deviations(report, slot, scale)
    worst = report.status(slot)
    return Estimate(
        value=None if worst == "unobservable" else _plain(values, block),
        std=_plain(largest, block),
        std_formal=_plain(formal, block),
        std_jackknife=None if jackknife is None else _plain(jackknife, block),
        status=worst,
        reason=None if worst == "measured" else report.reason(block, frame),
    )


def _values(report: Report, block: str, frame: int) -> NDArray[np.float64]:
    vector = report.fit.state.intrinsics[frame][INTRINSICS[block]]
    if block in ("focal", "aspect"):
        # Twelve digits: a given value comes back as given in spite of its logarithm.
        return np.array([float(f"{v:.12g}") for v in np.exp(vector)])
    if block == "distortion":
        used = int(np.max(np.nonzero(vector)[0], initial=-1)) + 1
        return vector[: max(used, report.plan.distortion_terms)]
    return vector


def _plain(values: NDArray[np.float64], block: str) -> float | list[float]:
    return float(values[0]) if block in ("focal", "aspect") else [float(v) for v in values]


def _deviations(
    report: Report, slot: slice, scale: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.float64]]:
    """Return formal, jackknife and the larger standard deviations of some columns."""
    formal = np.sqrt(np.diag(report.fit.uncertainty.formal)[slot]) * scale
    jackknives = _variances(report.fit)
    jackknife = np.sqrt(np.max(jackknives, axis=0)[slot]) * scale if jackknives else None
    return formal, jackknife, np.sqrt(np.diag(report.covariance)[slot]) * scale


def _status(
    outcome: Outcome, covariance: NDArray[np.float64], names: list[Unknown], slot: slice
) -> Status:
    """Return the status of a block with the unknowns ``names`` at ``slot``.

    Nothing is measured before the optimisation has settled; and what is weak then may be on its
    way along a valley that has no end.
    """
    worst = _worst(covariance, names, slot)
    if outcome is Outcome.CONVERGED or worst == "unobservable":
        return worst
    ended = outcome in (Outcome.STALLED, Outcome.MAX_ITERATIONS)
    return "unobservable" if worst == "weak" and ended else "weak"


def _worst(covariance: NDArray[np.float64], names: list[Unknown], slot: slice) -> Status:
    """Return the status that the least known unknown of a block has by its deviation."""
    deviations = np.sqrt(np.diag(covariance))[slot]
    return status_of(max(float(d) / n.scale for d, n in zip(deviations, names, strict=True)))


def _frame(report: Report, k: int, slips: int | None) -> Frame:
    fit = report.fit
    state = fit.state
    weight = fit.reported.weights[k]
    # Of the pattern as it is seen, not whitened.
    r2 = fit.reported.evaluation.squared(k) / fit.problem.frames[k].whitening ** 2
    used = weight > USED_WEIGHT
    per_frame_focal = report.plan.blocks["focal"] == "per_frame"
    valid = int(fit.maps[k].valid.sum())
    return Frame(
        name=fit.maps[k].name,
        projector_from_camera=_pose(report, "projector_pose", k, state.projector_from_camera[k]),
        world_from_camera=_pose(report, "camera_pose", k, state.world_from_camera[k]),
        focal=_intrinsic(report, "focal", k) if per_frame_focal else None,
        rms_px=float(np.sqrt(np.mean(r2[used]))) if used.any() else None,
        median_px=float(np.sqrt(np.nanmedian(r2))) if np.isfinite(r2).any() else None,
        used=int(used.sum()),
        outliers=1 - float(used.sum()) / max(valid, 1),
        slips=slips,
    )


def _pose(report: Report, block: str, frame: int, pose: RigidTransform) -> PoseEstimate:
    pose = report.unit.pose(pose)
    slot = report.plan.slot(block, frame)
    if slot is None:
        return PoseEstimate.of(pose, std=[0.0] * 6, status="fixed")
    status = report.status(slot)
    reason = None if status == "measured" else report.reason(block, frame)
    if status == "unobservable":
        return PoseEstimate(R=None, t=None, status=status, reason=reason)
    if block == "projector_pose" and report.ambiguous(frame):
        status, reason = "weak", f"{AMBIGUOUS}; {reason}" if reason else AMBIGUOUS
    known = report.fit.uncertainty
    jackknives = [c for c in (known.jackknife, known.frame_jackknife) if c is not None]
    candidates = [_pose_std(report, block, frame, c) for c in jackknives]
    return PoseEstimate.of(
        pose,
        std=_pose_std(report, block, frame, report.covariance),
        std_formal=_pose_std(report, block, frame, known.formal),
        std_jackknife=[float(x) for x in np.max(candidates, axis=0)] if candidates else None,
        status=status,
        reason=reason,
    )


def _pose_std(
    report: Report, block: str, frame: int, covariance: NDArray[np.float64]
) -> list[float]:
    """Return six standard deviations; the unit's own uncertainty adds to the translation's."""
    slot = report.plan.slot(block, frame)
    assert slot is not None
    chart = report.plan.local_to_global(report.fit.state, frame)
    rows = _local_rows(report.plan, block, frame)
    local = chart[rows] @ covariance @ chart[rows].T
    variance = np.maximum(np.diag(local), 0.0).copy()
    state = report.fit.state
    poses = state.projector_from_camera if block == "projector_pose" else state.world_from_camera
    variance[3:] += (poses[frame].t * report.unit.std_relative) ** 2
    variance[3:] *= report.unit.factor**2
    return [float(x) for x in np.sqrt(variance)]


def _local_rows(plan: Plan, block: str, frame: int) -> slice:
    start = 0
    for name in plan.active(frame):
        if name == block:
            break
        start += plan.local_width(name)
    return slice(start, start + plan.local_width(block))


def _warnings(report: Report) -> list[str]:
    fit = report.fit
    out = [report.unit.warning] if report.unit.warning else []
    if fit.optimum.outcome in (Outcome.MAX_ITERATIONS, Outcome.STALLED):
        free = report.directions[:1] if fit.optimum.outcome is Outcome.STALLED else []
        out.append(
            f"the optimisation stopped along a direction that the data hardly determine "
            f"({_listed(free[0].mixes)})"
            if free
            else "the optimisation had not converged; do not trust the values"
        )
    out += [f"frame {f.name} was left out: {f.reason}" for f in fit.left_out]
    plan = report.plan
    if plan.frames > 1 and plan.surface == plan.blocks["projector_pose"] == "per_frame":
        out.append(
            "frames that share neither surface nor projector pose each have a scale of their own: "
            "every baseline is taken to be as long as the first"
        )
    return out


def _looks(fit: Fit, camera: CameraModel, renderings: list[Rendering]) -> list[Look]:
    """Return what the frames see, baselines."""
    rays = camera.rays(camera.pixel_grid())
    return [
        Look(m, r.range[..., None] * rays, fit.state.world_from_camera[k],
             fit.problem.plan.surface_of(k))
        for k, (m, r) in enumerate(zip(fit.maps, renderings, strict=True))
    ]  # fmt: skip


def _listed(items: list[str]) -> str:
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    packages = ("mitsuba", "drjit", "numpy", "scipy", "opencv-python-headless")
    return {
        "mitsuba-endo": __version__,
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in packages},
    }
