"""Restarting an optimisation from a calibration that fits better than where it ended."""

from collections.abc import Callable, Sequence

import numpy as np

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...initialisation.alternative_poses import AlternativePose
from ...initialisation.given_pose import known_start
from ...initialisation.outlier_rejection import clean_map, noise_scale
from ...initialisation.result import Start
from ...records.correspondence import CorrespondenceMap
from ...records.solution import Outcome
from ..inference.alternative_solutions import superior
from ..inference.model_choice import cheaper
from ..minimisers.result import OptimisationResult

_EXPLAINED = 1.5
"""Residuals within this many times the maps' own noise need no better calibration."""
_RESTARTS = 3
"""Restarts in a row, each from the alternative of the last."""

Solve = Callable[[Sequence[Start]], OptimisationResult]


def with_restarts(
    maps: Sequence[CorrespondenceMap],
    starts: Sequence[Start],
    camera: CameraModel,
    solve: Solve,
) -> OptimisationResult:
    """Return the best result of solving from starts, and from what then turns out to fit better.

    A search may miss the best valley, above all under a model that is slightly wrong; the
    correspondences that the result keeps show it.

    Args:
        maps: of the frames.
        starts: of every frame.
        camera: which saw the maps.
        solve: optimises from starts of every frame.
    """
    best, starts = solve(starts), list(starts)
    for _ in range(_RESTARTS):
        if best.outcome is Outcome.INTERRUPTED or _explained(maps, best):
            break
        again = _restarted(maps, starts, camera, best)
        if again is None:
            break
        other = solve(again)
        if other.outcome is Outcome.INTERRUPTED or not cheaper(other, best):
            break
        best, starts = other, again
    return best


def _explained(maps: Sequence[CorrespondenceMap], result: OptimisationResult) -> bool:
    """Tell whether the residuals are about as large as the noise that the maps show themselves."""
    coordinates = [m.q.astype(np.float64) for m in maps]
    noise = [noise_scale(q, clean_map(q)) for q in coordinates]
    return result.noise.sigma < _EXPLAINED * max(noise)


def _restarted(
    maps: Sequence[CorrespondenceMap],
    starts: Sequence[Start],
    camera: CameraModel,
    result: OptimisationResult,
) -> list[Start] | None:
    """Return starts at the alternatives that fit better, None if there is none."""
    best: dict[int, AlternativePose] = {}
    for frames, alternative in superior(result):
        for k in frames:
            if k not in best or alternative.cost_ratio < best[k].cost_ratio:
                best[k] = alternative
    if not best:
        return None
    try:
        again = [
            _at(maps[k], start, camera, best[k]) if k in best else start
            for k, start in enumerate(starts)
        ]
    except InputError:  # too few correspondences remain before both devices
        return None
    # A pose that frames share may suit some of them so badly that nothing of them is left.
    return again if all(start.used.any() for start in again) else None


def _at(
    map_: CorrespondenceMap, start: Start, camera: CameraModel, alternative: AlternativePose
) -> Start:
    projector = start.projector.with_(focal=alternative.focal)
    return known_start(map_.q, camera, projector, alternative.projector_from_camera)
