"""From a fit to the solution that is saved."""

import platform
from dataclasses import asdict
from importlib import metadata

import numpy as np

from ... import __version__
from ...geometry.cameras import CameraModel
from ...records.calibration import Calibration
from ...records.history import scaled
from ...records.rig import Camera, Rig
from ...records.solution import Alternative, Estimate, Frame, ProjectorEstimate, Solution
from ...sanity.working_distance import working_distance
from ..frames.resume import checkpoint_of
from ..inference.alternative_solutions import describe_alternative
from ..inference.fit import Fit
from ..inference.observability import correlation, describe
from ..inference.period_errors import count_period_errors
from ..minimisers.render_result import Rendering, render_frames
from ..minimisers.result import USED_WEIGHT, with_fixed_cost
from ..options import Options
from ..unknowns.block import BLOCKS, VectorBlock
from .estimates import Estimates, inflation
from .model_section import model_section
from .scale import Unit, resolve_unit
from .surface_result import frame_maps, surface_estimate
from .verdict import verdict
from .warnings import fit_warnings

_PROJECTOR = ("focal", "centre", "aspect", "distortion")
"""Blocks that have fields of their own in a solution."""


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
    ranges = {m.name: r.range for m, r in zip(fit.maps, renderings, strict=True)}
    refined = fit.problem.camera(fit.state)
    unit = resolve_unit(rig, refined, [ranges.get(name) for name in fit.given])
    estimates = Estimates(fit, unit)
    surfaces = [
        surface_estimate(fit, i, unit.factor, inflation(fit))
        for i in range(fit.problem.layout.surfaces)
    ]
    solution = Solution(
        outcome=fit.result.outcome,
        units=unit.name,
        scale=unit.kind,
        scale_std_percent=100 * unit.std_relative,
        camera=Camera.from_model(refined),
        projector=_projector(estimates, rig),
        blocks=_further_blocks(estimates),
        frames=_frames(estimates, rig, renderings),
        left_out=fit.left_out,
        alternatives=_alternatives(estimates),
        surface="surface.ply",
        noise_px=fit.uncertainty.sigma,
        law_evidence=law_evidence or {},
        model=model_section(fit),
        observability={
            "before_optimising": describe(fit.predicted),
            "free_directions": describe(estimates.directions),
            "correlation": correlation(estimates.covariance, estimates.names),
        },
        timings=fit.timings,
        versions=versions(),
        configuration={"options": asdict(options), "rig": rig.model_dump(mode="json")},
        warnings=[
            *fit_warnings(estimates, refined, renderings, warnings or []),
            *_implausible_scale(fit, unit, renderings, rig),
        ],
    )
    solution = solution.model_copy(update={"verdict": verdict(solution, fit.refuted)})
    return Calibration(
        solution, refined, surfaces[0], frame_maps(fit, renderings),
        with_fixed_cost(fit.result.trace, fit.result.noise),
        checkpoint_of(fit.result, rig), dict(enumerate(surfaces[1:], 1)),
        scaled(fit.history, unit.factor),
    )  # fmt: skip


def _implausible_scale(fit: Fit, unit: Unit, renderings: list[Rendering], rig: Rig) -> list[str]:
    """Return a warning where the scale implies a working distance that no such rig has."""
    ranges = renderings[0].range[np.isfinite(renderings[0].range)]
    if not len(ranges):
        return []
    baseline = unit.factor * float(np.linalg.norm(fit.state.at("projector_pose", 0).t))
    findings = working_distance(baseline, unit.factor * float(np.median(ranges)), rig)
    return [finding.warning for finding in findings]


def _alternatives(estimates: Estimates) -> list[Alternative]:
    fit = estimates.fit
    return [
        describe_alternative(
            alternative,
            [fit.maps[k].name for k in frames],
            estimates.unit.pose(fit.state.at("projector_pose", frames[0])),
            fit.state.focals[frames[0]],
        )
        for frames, alternative in estimates.alternatives
    ]


def _projector(estimates: Estimates, rig: Rig) -> ProjectorEstimate:
    projector = rig.projector
    own = estimates.layout.sharing("focal") == "per_frame"
    per_frame = Estimate(
        value=None, status="unobservable", reason="it is per frame; see frames[].focal"
    )
    return ProjectorEstimate(
        law=estimates.fit.law, width=projector.width, height=projector.height,
        focal=per_frame if own else estimates.vector("focal", 0),
        centre=estimates.vector("centre", 0), aspect=estimates.vector("aspect", 0),
        distortion=estimates.vector("distortion", 0),
    )  # fmt: skip


def _further_blocks(estimates: Estimates) -> dict[str, Estimate]:
    """Return the unknown blocks that a solution has no field for, by name."""
    return {
        name: estimates.vector(name, 0)
        for name, block in BLOCKS.items()
        if isinstance(block, VectorBlock) and name not in _PROJECTOR and estimates.layout.free[name]
    }


def _frames(estimates: Estimates, rig: Rig, renderings: list[Rendering]) -> list[Frame]:
    fit, period = estimates.fit, rig.projector.grid_period
    return [
        _frame(estimates, k, None if period is None else count_period_errors(map_.q, r.q, period))
        for k, (map_, r) in enumerate(zip(fit.maps, renderings, strict=True))
    ]


def _frame(estimates: Estimates, k: int, period_errors: int | None) -> Frame:
    fit = estimates.fit
    at = fit.reported.evaluation.frames[k]
    # Of the pattern as it is seen, not whitened.
    r2 = (fit.problem.observed[k].unwhitened(at.residual) ** 2).sum(0)
    r2 = np.where(at.hits, r2, np.nan)
    used = fit.reported.weights[k] > USED_WEIGHT
    per_frame_focal = estimates.layout.sharing("focal") == "per_frame"
    valid = int(fit.maps[k].valid.sum())
    return Frame(
        name=fit.maps[k].name,
        projector_from_camera=estimates.pose("projector_pose", k),
        world_from_camera=estimates.pose("camera_pose", k),
        focal=estimates.vector("focal", k) if per_frame_focal else None,
        rms_px=float(np.sqrt(np.mean(r2[used]))) if used.any() else None,
        median_px=float(np.sqrt(np.nanmedian(r2))) if np.isfinite(r2).any() else None,
        used=int(used.sum()),
        outliers=1 - float(used.sum()) / max(valid, 1),
        slips=period_errors,
    )


def versions() -> dict[str, str]:
    """Return the versions that a result depends on."""
    packages = ("mitsuba", "drjit", "numpy", "scipy", "opencv-python-headless")
    return {
        "mitsuba-endo": __version__,
        "python": platform.python_version(),
        **{name: metadata.version(name) for name in packages},
    }
