"""What a user must know of a solution besides its verdict."""

from collections.abc import Sequence

from ...geometry.cameras import CameraModel
from ...records.solution import Outcome
from ..minimisers.render_result import Rendering
from .estimates import Estimates, listed
from .grouping import grouped
from .model_section import model_warnings
from .redundancy import FrameView, redundancy_warnings


def fit_warnings(
    estimates: Estimates,
    camera: CameraModel,
    renderings: Sequence[Rendering],
    of_model: Sequence[str],
) -> list[str]:
    """Return all warnings about a fit.

    Args:
        estimates: of its unknowns.
        camera: which saw the frames.
        renderings: of the frames.
        of_model: what the choice of the projection model says.
    """
    fit = estimates.fit
    views = [
        FrameView(m, r.range[..., None] * camera.grid_rays, fit.state.at("camera_pose", k),
                  fit.problem.layout.surface_of[k])
        for k, (m, r) in enumerate(zip(fit.maps, renderings, strict=True))
    ]  # fmt: skip
    return [
        *fit.notes,
        *of_model,
        *([estimates.unit.warning] if estimates.unit.warning else []),
        *_convergence(estimates),
        *model_warnings(fit),
        *grouped(
            [(f.name, f.reason) for f in fit.left_out],
            "frame {names} was left out",
            "{count} frames were left out ({names}), e.g.",
        ),
        *_separate_scales(estimates),
        *redundancy_warnings(views, camera, fit.uncertainty.sigma),
    ]


def _convergence(estimates: Estimates) -> list[str]:
    outcome = estimates.fit.result.outcome
    if outcome is Outcome.STALLED and estimates.directions:
        return [
            "the optimisation stopped along a direction that the data hardly determine "
            f"({listed(estimates.directions[0].mixes)})"
        ]
    if outcome in (Outcome.MAX_ITERATIONS, Outcome.STALLED):
        return ["the optimisation had not converged; do not trust the values"]
    return []


def _separate_scales(estimates: Estimates) -> list[str]:
    layout = estimates.layout
    if layout.surfaces > 1 and layout.sharing("projector_pose") == "per_frame":
        return [
            "frames that share neither surface nor projector pose each have a scale of their own: "
            "every baseline is taken to be as long as the first"
        ]
    return []
