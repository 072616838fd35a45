"""Gauss-Newton against the published first-order solver: same objective, unknowns and start."""

from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_endo.records.calibration import TraceRow
from mitsuba_endo.solve.costs.objective import Problem, evaluate
from mitsuba_endo.solve.frames.initial_poses import start_frame
from mitsuba_endo.solve.frames.separate_surfaces import separate_surfaces
from mitsuba_endo.solve.minimisers.minimise import minimise
from mitsuba_endo.solve.minimisers.result import OptimisationResult
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.unknowns.layout import make_layout
from mitsuba_endo.solve.unknowns.state import State

from .report import Figure, timed
from .scene import PLANE_MM, Scene, make_scene

NAME = "adam"
_WITHIN = 1.01
"""A state is at the optimum when its loss is at most this many times Gauss-Newton's."""
StartName = Literal["search", "plane"]


def run(quick: bool) -> list[Figure]:
    """Time both optimisers, without start and uncertainty, from both starts."""
    scene = make_scene(80, 60) if quick else make_scene()
    with threadpool_limits(1, "blas"):  # as calibrate does
        return [f for start in ("plane", "search") for f in _compare(scene, start)]


def _compare(scene: Scene, start: StartName) -> list[Figure]:
    options = Options(start=start, plane_distance=PLANE_MM / scene.baseline)
    law = scene.rig.projector.law
    layout = make_layout(scene.rig, 1)
    first = start_frame(scene.map, scene.camera, scene.rig, layout, law, options)
    problem, state = separate_surfaces(
        [scene.map], [first], scene.camera, scene.rig, layout, law, options
    )
    minimise(problem, state, options)  # compiles
    slow = replace(options, solver="adam")
    minimise(problem, state, replace(slow, adam_iterations=100))
    runs = [timed(lambda: minimise(problem, state, options)) for _ in range(5)]
    adam_time, adam = timed(lambda: minimise(problem, state, slow))
    # On both sides of the long run, since the machine's load changes.
    runs += [timed(lambda: minimise(problem, state, options)) for _ in range(5)]
    newton_time, newton = float(np.median([t for t, _ in runs])), runs[0][1]
    arrivals = [time_of_arrival(problem, state, options, newton) for _ in range(5)]
    ratio = adam.evaluation.cost(newton.noise) / newton.cost
    figure = partial(Figure, NAME)
    within = time_of_arrival(problem, state, slow, newton) / float(np.median(arrivals))
    return [
        figure(f"{start}: loss / Gauss-Newton's", ratio, "ratio", "lower", _WITHIN),
        figure(f"{start}: time until converged / Gauss-Newton's", adam_time / newton_time,
               "ratio", "higher", 50),
        figure(f"{start}: time until within 1 % of the loss / Gauss-Newton's", within,
               "ratio", "higher"),
        figure(f"{start}: Adam", adam_time, "s", "lower"),
        figure(f"{start}: Gauss-Newton", newton_time, "s", "lower"),
        figure(f"{start}: Adam's iterations", adam.trace[-1].iteration, "", "lower"),
        figure(f"{start}: Gauss-Newton's iterations", len(newton.trace), "", "lower"),
    ]  # fmt: skip


def time_of_arrival(
    problem: Problem, state: State, options: Options, optimum: OptimisationResult
) -> float:
    """Return the seconds until the loss is within 1 % of the optimum's, both under its scale.

    Adam looks at its loss every 100 iterations only; the looks here are not counted.
    """
    arrived: list[float] = []
    looking = 0.0

    def look(row: TraceRow, at: State) -> None:
        nonlocal looking
        seconds, cost = timed(lambda: evaluate(problem, at).cost(optimum.noise))
        if not arrived and cost <= _WITHIN * optimum.cost:
            arrived.append(row.seconds - looking)
        looking += seconds

    minimise(problem, state, options, on_iteration=look)
    return arrived[0] if arrived else float("nan")
