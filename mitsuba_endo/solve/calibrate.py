"""Calibration: from correspondence maps and a rig to projector, poses and surface."""

import time

from threadpoolctl import threadpool_limits

from ..errors import InputError
from ..geometry.cameras import CameraModel
from ..geometry.laws import LAWS
from ..records.calibration import Calibration
from ..records.consistency import check_maps
from ..records.correspondence import CorrespondenceMap
from ..records.rig import AUTO_LAW, Rig
from ..start.known import known_start
from ..start.plane import plane_start
from ..start.result import Start
from ..start.search import search_start
from .assemble import assemble
from .fit import Fit
from .options import Options
from .plan import make_plan
from .run import Progress, fit
from .single import separate_surfaces


def calibrate(
    maps: list[CorrespondenceMap],
    rig: Rig,
    options: Options | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Calibrate a projector from correspondence maps.

    Args:
        maps: one for each frame.
        rig: what is known, and which unknowns the frames share.
        options: how to solve.
        progress: called with the share of the work done and the name of the step.

    Returns:
        The solution with the surface, the rendered maps and the trace of the optimisation.

    Raises:
        InputError: maps or rig that cannot be used; says what to do.
    """
    options = options or Options()
    say = progress or (lambda _share, _step: None)
    check_maps(maps, rig)
    camera = rig.camera.to_model()
    laws = list(LAWS) if rig.projector.law == AUTO_LAW else [rig.projector.law]
    # One thread: the matrices are too small for two, which then wait for each other.
    with threadpool_limits(1, "blas"):
        fits = [_fit(law, maps, camera, rig, options, say) for law in laws]
        say(0.9, "Assembling the solution")
        return assemble(fits[0], camera, rig, options)


def _fit(
    law: str,
    maps: list[CorrespondenceMap],
    camera: CameraModel,
    rig: Rig,
    options: Options,
    say: Progress,
) -> Fit:
    began = time.perf_counter()
    say(0.05, "Searching for a start")
    starts = [start_frame(m, camera, rig, law, options) for m in maps]
    timings = {"start": time.perf_counter() - began}
    say(0.4, "Optimising")
    plan = make_plan(rig, len(maps))
    problem, state = separate_surfaces(maps, starts, camera, plan, law, options)
    notes = [note for s in starts for note in s.notes]
    return fit(problem, state, maps, options, notes=notes, timings=timings)


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
