"""Observability before the optimisation: what the data can tell, judged at the start.

A forecast, made where surface and poses are only roughly right; the verdict at the solution
counts neither regularisers nor noise as information and replaces it.
"""

from ..costs.noise_scale import NoiseScale
from ..costs.objective import Problem, evaluate
from ..unknowns.state import State
from .observability import Direction, free_directions, problem_unknowns
from .sandwich_covariance import inverse_information


def predicted_directions(problem: Problem, state: State, last_loss: str) -> list[Direction]:
    """Return the directions in the space of unknowns that will be weak or free, worst first.

    Args:
        problem: what is to be solved.
        state: where the optimisation starts.
        last_loss: name of the loss of the last stage.
    """
    at = evaluate(problem, state)
    noise = NoiseScale(at.noise(), last_loss, last=True)
    information = at.normal_equations(noise).reduce().S
    covariance = noise.sigma**2 * inverse_information(information)
    return free_directions(covariance, problem_unknowns(problem, state))
