"""Gauss-Newton against the published first-order solver: same objective, unknowns and start."""

from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from threadpoolctl import threadpool_limits

from mitsuba_endo.records.calibration import TraceRow
from mitsuba_endo.solve.cost.objective import Objective, evaluate
from mitsuba_endo.solve.cost.problem import Problem
from mitsuba_endo.solve.optimise.optimum import Optimum
from mitsuba_endo.solve.optimise.run import optimise
from mitsuba_endo.solve.options import Options
from mitsuba_endo.solve.prepare.frames import start_frame
from mitsuba_endo.solve.prepare.single import separate_surfaces
from mitsuba_endo.solve.unknowns.plan import make_plan
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
    first = start_frame(scene.map, scene.camera, scene.rig, law, options)
    plan = make_plan(scene.rig, 1)
    problem, state = separate_surfaces([scene.map], [first], scene.camera, plan, law, options)
    optimise(problem, state, options)  # compiles
    slow = replace(options, solver="adam")
    optimise(problem, state, replace(slow, adam_iterations=100))
    runs = [timed(lambda: optimise(problem, state, options)) for _ in range(5)]
    adam_time, adam = timed(lambda: optimise(problem, state, slow))
    # On both sides of the long run, since the machine's load changes.
    runs += [timed(lambda: optimise(problem, state, options)) for _ in range(5)]
    newton_time, newton = float(np.median([t for t, _ in runs])), runs[0][1]
    arrivals = [time_of_arrival(problem, state, options, newton) for _ in range(5)]
    ratio = newton.objective.cost(adam.evaluation) / newton.cost
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


def time_of_arrival(problem: Problem, state: State, options: Options, optimum: Optimum) -> float:
    """Return the seconds until the loss is within 1 % of the optimum's, both under its scale.

    Adam looks at its loss every 100 iterations only; the looks here are not counted.
    """
    objective: Objective = optimum.objective
    arrived: list[float] = []
    looking = 0.0

    def look(row: TraceRow, at: State) -> None:
        nonlocal looking
        seconds, cost = timed(lambda: objective.cost(evaluate(problem, at)))
        if not arrived and cost <= _WITHIN * optimum.cost:
            arrived.append(row.seconds - looking)
        looking += seconds

    optimise(problem, state, options, on_iteration=look)
    return arrived[0] if arrived else float("nan")
