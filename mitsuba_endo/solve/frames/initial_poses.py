"""The initial poses of all frames: each alone, or one projector pose for all."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...geometry.projection_models import ProjectorModel
from ...initialisation.given_pose import known_start, start_at_pose
from ...initialisation.outlier_rejection import clean_map
from ...initialisation.plane import plane_start
from ...initialisation.result import Candidate, Start
from ...initialisation.search import search_start
from ...records.consistency import fault
from ...records.correspondence import CorrespondenceMap
from ...records.rig import Rig
from ...records.solution import LeftOut
from ...sanity.handedness import handedness
from ..options import Options
from ..unknowns.layout import Layout

OnFrame = Callable[[int, int], None]
"""Called with the number of a frame, from 1, and how many there are."""


def start_frame(
    map_: CorrespondenceMap,
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
    law: str,
    options: Options,
) -> Start:
    """Return the start of one frame by the method that options and rig ask for.

    A pose in the rig is where to begin; else the options decide. What the layout fixes is not
    searched for.

    Raises:
        InputError: no start can be found; names the map.
    """
    projector = rig.projector.to_model(law)
    size = (rig.projector.width, rig.projector.height)
    given, focal = rig.projector.pose, rig.projector.focal.value
    try:
        if given is not None:
            pose = given.to_transform()
            if focal is not None:
                return known_start(map_.q, camera, projector, pose)
            return start_at_pose(map_.q, camera, projector, pose, size)
        if options.start == "plane":
            return plane_start(map_.q, camera, projector, distance=options.plane_distance)
        return search_start(
            map_.q, camera, projector, size, refine_focal=layout.free["focal"], focal_guess=focal,
            seed=options.seed,
        )  # fmt: skip
    except InputError as error:
        raise InputError(error.what, error.where or map_.name, error.todo) from error


def usable_starts(
    maps: Sequence[CorrespondenceMap],
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
    law: str,
    options: Options,
    given: Mapping[str, Start],
    on_frame: OnFrame | None = None,
) -> tuple[list[CorrespondenceMap], list[Start], list[LeftOut]]:
    """Start every frame; frames without a start are left out by name.

    Args:
        maps: of the frames.
        camera: which saw them.
        rig: what is known.
        layout: of the unknowns.
        law: the projection model.
        options: how to solve.
        given: starts of some frames, by name, that need not be searched for again.
        on_frame: called with the number of each, from 1, and how many there are.

    Raises:
        InputError: no frame has a start.
    """
    kept, starts, left_out = [], [], []
    failure: InputError | None = None
    for k, map_ in enumerate(maps, 1):
        if on_frame is not None:
            on_frame(k, len(maps))
        try:
            start = given.get(map_.name)
            starts.append(start or start_frame(map_, camera, rig, layout, law, options))
            kept.append(map_)
        except InputError as error:
            failure = error
            left_out.append(LeftOut(name=map_.name, reason=error.what))
    if not kept and failure is not None:
        raise failure
    return kept, starts, left_out


def without_faults(
    maps: list[CorrespondenceMap], rig: Rig
) -> tuple[list[CorrespondenceMap], list[LeftOut]]:
    """Leave out maps that cannot belong to the rig, or to any surface."""
    faults = [fault(m, rig) or next(iter(handedness([m], rig)), None) for m in maps]
    left_out = [LeftOut(name=m.name, reason=f.what) for m, f in zip(maps, faults, strict=True) if f]
    return [m for m, f in zip(maps, faults, strict=True) if f is None], left_out


def without_repeats(
    maps: list[CorrespondenceMap],
) -> tuple[list[CorrespondenceMap], list[LeftOut]]:
    """Leave out maps that are copies of an earlier one: they add nothing and would count twice."""
    kept: list[CorrespondenceMap] = []
    left_out = []
    for map_ in maps:
        original = next((k for k in kept if np.array_equal(k.q, map_.q, equal_nan=True)), None)
        if original is None:
            kept.append(map_)
        else:
            left_out.append(LeftOut(name=map_.name, reason=f"it is a copy of {original.name}"))
    return kept, left_out


def common_start(
    maps: Sequence[CorrespondenceMap],
    starts: Sequence[Start],
    camera: CameraModel,
    *,
    share_focal: bool,
) -> list[Start]:
    """Return starts with one projector pose: the one that suits all frames best.

    Every frame proposes its minimum and the competing ones; the median over frames of the robust
    residual scale decides, which one bad frame does not sway.

    Args:
        maps: of the frames.
        starts: of every frame alone.
        camera: which saw the maps.
        share_focal: whether all have the focal length of the chosen proposal; else each its own.
    """
    usable = [clean_map(m.q.astype(np.float64)) for m in maps]
    best: list[Start] = []
    lowest = np.inf
    for candidate in _proposals(starts):
        projectors = [_with_focal(s, candidate, share_focal) for s in starts]
        try:
            trial = [
                known_start(m.q, camera, p, candidate.projector_from_camera, keep)
                for m, p, keep in zip(maps, projectors, usable, strict=True)
            ]
        except InputError:
            continue
        # A pose that leaves most points behind a device is no candidate, however well it fits.
        kept_share = min(
            t.used.sum() / max(s.used.sum(), 1) for t, s in zip(trial, starts, strict=True)
        )
        scale = float(np.median([t.scale_px for t in trial])) / max(float(kept_share), 1e-3)
        if scale < lowest:
            best, lowest = trial, scale
    return best or list(starts)


def _proposals(starts: Sequence[Start]) -> list[Candidate]:
    """Return every start's own calibration and its alternatives."""
    own = [Candidate(s.projector_from_camera, float(s.projector.focal), 0.0, 1.0) for s in starts]
    return [c for o, s in zip(own, starts, strict=True) for c in (o, *s.alternatives)]


def _with_focal(start: Start, candidate: Candidate, share_focal: bool) -> ProjectorModel:
    return start.projector.with_(focal=candidate.focal) if share_focal else start.projector
