"""Frames solved alone, before they are brought together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...geometry.cameras import CameraModel
from ...initialisation.result import Start
from ...records.correspondence import CorrespondenceMap
from ...records.rig import Rig
from ...records.solution import Outcome
from ..inference.fit import FrameSolution
from ..minimisers.minimise import minimise
from ..minimisers.render_result import render_frames
from ..minimisers.result import USED_WEIGHT, OptimisationResult
from ..minimisers.surface_smoothing import smooth_surfaces
from ..options import Options
from ..surfaces.inverse_range_lattice import Lattice
from ..unknowns.layout import Layout
from .initial_poses import OnFrame
from .restart import with_restarts
from .separate_surfaces import separate_surfaces

_USABLE = 2
"""Frames from which on there is something to bring together when the user stops."""


def solve_alone(
    maps: Sequence[CorrespondenceMap],
    starts: Sequence[Start],
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
    law: str,
    options: Options,
    on_frame: OnFrame | None = None,
) -> list[FrameSolution]:
    """Optimise every frame alone, with the blocks that the layout frees.

    ``on_frame`` is called with the number of each, from 1, and how many there are.

    Returns:
        Of every frame; of those that were done where the user stopped.

    Raises:
        KeyboardInterrupt: the user stopped before two frames were done.
    """

    def solve(map_: CorrespondenceMap, start: Start) -> OptimisationResult:
        own = layout.alone()
        return minimise(
            *separate_surfaces([map_], [start], camera, rig, own, law, options), options
        )

    out = []
    for k, (map_, start) in enumerate(zip(maps, starts, strict=True), 1):
        try:
            if on_frame is not None:
                on_frame(k, len(maps))
            result = with_restarts([map_], [start], camera, lambda s, m=map_: solve(m, s[0]))
            if result.outcome is Outcome.INTERRUPTED:
                raise KeyboardInterrupt
            out.append(frame_solution(result, camera, options, start.notes))
        except KeyboardInterrupt:
            if len(out) < _USABLE:
                raise
            break
    return out


def frame_solution(
    result: OptimisationResult, camera: CameraModel, options: Options, notes: list[str]
) -> FrameSolution:
    """Keep of the result of one frame alone what the joint solution needs.

    The rest, most of all the scene for the ray tracer, is as large as many input maps.
    """
    problem, state = result.problem, result.state
    (lattice,) = problem.surfaces
    assert isinstance(lattice, Lattice)
    registered = options.cameras == "registration"
    smooth = render_frames(smooth_surfaces(result, options), camera)[0] if registered else None
    return FrameSolution(
        observations=problem.observed[0],
        cell=lattice.cell,
        points=lattice.vertices(state.surfaces[0]),
        state=replace(state, surfaces=(np.zeros(0),)),
        squared=result.evaluation.squared(0),
        used=result.weights[0] > USED_WEIGHT,
        information=result.normal_equations().reduce().S / result.noise.sigma**2,
        range=None if smooth is None else smooth.range,
        notes=notes,
    )
