"""Whether frames have of their own what the plan says they share."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from ....errors import InputError
from ....records.rig import Rig
from ...minimisers.result import OptimisationResult
from ...unknowns.block import BLOCKS
from ...unknowns.layout import Layout, make_layout
from .extended import freed, over, widened

_RANK = 1e-9
"""Of the scaled Schur complement: directions below tell nothing."""


@dataclass(frozen=True)
class PlanTest:
    """A block that frames share, and what one value for each frame would gain."""

    block: str
    words: str
    mode: str
    gain: float
    """Predicted fall of the weighted sum of squared residuals."""
    chance: float
    """Probability that noise alone gains as much."""


def plan_tests(result: OptimisationResult, rig: Rig, noise: float) -> list[PlanTest]:
    """Test every block of which several frames have one value.

    Args:
        result: the fit, where its gradient vanishes.
        rig: of it.
        noise: variance of one coordinate times its design effect.
    """
    out = []
    for name, layout in alternatives(result.problem.layout, rig):
        gain, further = _gain(result, layout)
        chance = float(chdtrc(max(further, 1), max(gain, 0.0) / noise))
        out.append(PlanTest(name, BLOCKS[name].words, "per_frame", gain, chance))
    return sorted(out, key=lambda t: -t.gain)


def alternatives(old: Layout, rig: Rig) -> Iterator[tuple[str, Layout]]:
    """Yield every block that several frames share, and the layout in which each has its own."""
    for name, block in BLOCKS.items():
        shared = old.frames > 1 and old.sharing(name) == "shared" and old.widths[name] > 0
        if not shared or "per_frame" not in block.modes or name == "camera_pose":
            continue
        try:
            layout = make_layout(freed(rig, [name], "per_frame"), old.frames)
        except InputError:  # a plan that contradicts itself is no alternative
            continue
        yield name, replace(layout, surface_of=old.surface_of)


def _gain(result: OptimisationResult, layout: Layout) -> tuple[float, int]:
    """Return the fall of the sum of squares that a layout promises, and its further unknowns."""
    old = result.problem.layout
    state = widened(result.state, old, layout)
    terms = [over(term, layout) for term in result.problem.others]
    problem = result.problem.with_layout(layout, *terms)
    at = replace(
        result.evaluation, problem=problem, state=state,
        parts=[*_frames(result, state), *(t.evaluate(state) for t in terms)],
    )  # fmt: skip
    reduced = at.normal_equations(result.noise, result.weights).reduce()
    scale = 1 / np.sqrt(np.maximum(np.diag(reduced.S), 1e-300))
    values, vectors = np.linalg.eigh(reduced.S * np.outer(scale, scale))
    along = vectors.T @ (scale * reduced.g)
    kept = values > _RANK * values[-1]
    return float((along[kept] ** 2 / values[kept]).sum()), layout.columns - old.columns


def _frames(result: OptimisationResult, state: object) -> Iterator[object]:
    """Yield what the frames see, without derivatives over other unknowns."""
    for at in result.evaluation.frames:
        yield replace(at, state=state, kept=[])  # pyright: ignore[reportArgumentType]
