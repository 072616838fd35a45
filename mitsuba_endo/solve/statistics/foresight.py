"""Observability before the optimisation: what the data can tell, judged at the start.

A forecast, made where surface and poses are only roughly right; the verdict at the solution
counts neither prior nor noise as information and replaces it.
"""

from ..cost.objective import Objective, estimate_noise, evaluate
from ..cost.problem import Problem
from ..unknowns.state import State
from .information import inverse_information
from .observability import Direction, free_directions, unknowns


def foreseen_directions(problem: Problem, state: State, finish: str) -> list[Direction]:
    """Return the directions in the space of unknowns that will be weak or free, worst first.

    Args:
        problem: what is to be solved.
        state: where the optimisation starts.
        finish: name of the loss of the last stage.
    """
    at = evaluate(problem, state)
    objective = Objective(problem, finish, sigma=estimate_noise(at), stage=1)
    information = objective.normal_equations(at).reduce().S
    covariance = objective.sigma**2 * inverse_information(information)
    return free_directions(covariance, unknowns(problem.plan, state), problem.plan)
