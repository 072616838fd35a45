"""The starts of all frames: each alone, or one projector pose for all."""

import numpy as np

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...records.consistency import fault
from ...records.correspondence import CorrespondenceMap
from ...records.rig import Rig
from ...records.solution import LeftOut, Outcome
from ...start.clean import clean_map
from ...start.known import known_start
from ...start.plane import plane_start
from ...start.result import Candidate, Start
from ...start.search import search_start
from ..optimise.run import optimise
from ..options import Options
from ..unknowns.plan import Plan
from .joint import FrameStart, frame_start, single_plan
from .single import separate_surfaces


def start_frame(
    map_: CorrespondenceMap, camera: CameraModel, rig: Rig, law: str, options: Options
) -> Start:
    """Return the start of one frame by the method that options and rig ask for.

    A pose in the rig is taken as the start; else the options decide.

    Raises:
        InputError: no start can be found; names the map.
    """
    projector = rig.projector.to_model(law)
    given = rig.projector.pose
    try:
        if given is not None and rig.projector.focal.value is not None:
            return known_start(map_.q, camera, projector, given.to_transform())
        if options.start == "plane":
            return plane_start(map_.q, camera, projector, distance=options.plane_distance)
        return search_start(
            map_.q, camera, projector, (rig.projector.width, rig.projector.height),
            refine_focal=rig.projector.focal.refine, focal_guess=rig.projector.focal.value,
            seed=options.seed,
        )  # fmt: skip
    except InputError as error:
        raise InputError(error.what, error.where or map_.name, error.todo) from error


def usable_starts(
    maps: list[CorrespondenceMap], camera: CameraModel, rig: Rig, law: str, options: Options
) -> tuple[list[CorrespondenceMap], list[Start], list[LeftOut]]:
    """Start every frame; frames without a start are left out by name.

    Raises:
        InputError: no frame has a start.
    """
    kept, starts, left_out = [], [], []
    failure: InputError | None = None
    for map_ in maps:
        try:
            starts.append(start_frame(map_, camera, rig, law, options))
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
    """Leave out maps that cannot belong to the rig."""
    faults = [fault(map_, rig) for map_ in maps]
    left_out = [LeftOut(name=m.name, reason=f.what) for m, f in zip(maps, faults, strict=True) if f]
    return [m for m, f in zip(maps, faults, strict=True) if f is None], left_out


def without_repeats(
    maps: list[CorrespondenceMap],
) -> tuple[list[CorrespondenceMap], list[LeftOut]]:
    """Leave out maps that are copies of an earlier one: they add nothing and would count twice."""
    kept: list[CorrespondenceMap] = []
    left_out = []
    for map_ in maps:
        twin = next((k for k in kept if np.array_equal(k.q, map_.q, equal_nan=True)), None)
        if twin is None:
            kept.append(map_)
        else:
            left_out.append(LeftOut(name=map_.name, reason=f"it is a copy of {twin.name}"))
    return kept, left_out


def common_start(
    maps: list[CorrespondenceMap], starts: list[Start], camera: CameraModel
) -> list[Start]:
    """Return starts with one projector pose and focal length: those that suit all frames best.

    Every frame proposes its minimum and the competing ones; the median over frames of the robust
    residual scale decides, which one bad frame does not sway.
    """
    proposals = [
        c
        for s in starts
        for c in (
            Candidate(s.projector_from_camera, float(s.projector.focal), 0.0, 1.0),
            *s.alternatives,
        )
    ]
    usable = [clean_map(m.q.astype(np.float64)) for m in maps]
    best: list[Start] = []
    lowest = np.inf
    for candidate in proposals:
        projector = starts[0].projector.with_(focal=candidate.focal)
        try:
            trial = [
                known_start(m.q, camera, projector, candidate.projector_from_camera, keep)
                for m, keep in zip(maps, usable, strict=True)
            ]
        except InputError:
            continue
        # A pose that leaves most points behind a device is no candidate, however well it fits.
        seen = min(t.used.sum() / max(s.used.sum(), 1) for t, s in zip(trial, starts, strict=True))
        scale = float(np.median([t.scale_px for t in trial])) / max(float(seen), 1e-3)
        if scale < lowest:
            best, lowest = trial, scale
    return best or starts


def solve_alone(
    maps: list[CorrespondenceMap],
    starts: list[Start],
    camera: CameraModel,
    plan: Plan,
    law: str,
    options: Options,
) -> list[FrameStart]:
    """Optimise every frame alone, with the blocks that the plan frees.

    Raises:
        KeyboardInterrupt: the user stopped: there is nothing yet to go on from.
    """
    out = []
    for map_, start in zip(maps, starts, strict=True):
        problem, state = separate_surfaces([map_], [start], camera, single_plan(plan), law, options)
        optimum = optimise(problem, state, options)
        if optimum.outcome is Outcome.INTERRUPTED:
            raise KeyboardInterrupt
        out.append(frame_start(optimum, camera, options, start.notes))
    return out
