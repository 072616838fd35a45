"""A fit's normal equations with further columns: values that were given, and what no block is.

The columns are eliminated against the unknowns and the surfaces by the Schur complement, so that
what is left of one is what nothing that is solved for can imitate.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....records.rig import Rig, Share, Sharing
from ...costs.coordinate_residual import CoordinateTerm
from ...costs.smoothness import SmoothnessTerm
from ...elimination.linearisation import Linearisation
from ...elimination.normal_equations import NormalEquations
from ...minimisers.result import OptimisationResult
from ...unknowns.block import BLOCKS
from ...unknowns.layout import Layout, make_layout
from ...unknowns.state import State
from ..response import response
from .special import Special

Floats = NDArray[np.float64]

_PIXELS = 65536
"""Pixels handled at once."""


def freed(rig: Rig, names: Sequence[str], mode: Sharing = "shared") -> Rig:
    """Return the rig with the sharing of some blocks replaced."""
    fields = {n: mode for n in names if n in Share.model_fields}
    further = {**rig.share.further, **{n: mode for n in names if n not in fields}}
    share = rig.share.model_copy(update={**fields, "further": further})
    return rig.model_copy(update={"share": share})


def given_blocks(layout: Layout) -> list[str]:
    """Return the blocks that are given and could be unknowns instead."""
    return [
        name
        for name, block in BLOCKS.items()
        if not layout.free[name] and name != "camera_pose" and "shared" in block.modes
        and layout.given[name] is not None
    ]  # fmt: skip


def widened(state: State, old: Layout, layout: Layout) -> State:
    """Return the state over another layout: values that were given may have more components."""
    values = dict(state.values)
    for name, owners in layout.owners.items():
        kept = [state.at(name, owners.index(k)) for k in range(max(owners) + 1)]
        is_new = layout.free[name] and not old.free[name]
        values[name] = (layout.given[name],) * len(kept) if is_new else tuple(kept)
    return State(state.surfaces, values, layout.owners)


def over(term: Any, layout: Layout) -> Any:
    """Return a term over other unknowns, if it hangs on them."""
    hangs = is_dataclass(term) and any(f.name == "layout" for f in fields(term))
    return replace(term, layout=layout) if hangs else term  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True, eq=False)
class Extended:
    """Normal equations of a fit over its unknowns and further columns."""

    result: OptimisationResult
    layout: Layout
    """Of unknowns and given values."""
    state: State
    specials: Sequence[Special]
    S: Floats
    """(G, G) Schur complement: columns of the layout, then one for each special."""
    g: Floats
    """(G,) reduced gradient."""
    responses: list[Floats]
    """(V, G) of every surface, A^-1 B."""
    solved: NDArray[np.bool_]
    """(G,) columns that are unknowns of the fit."""

    def directions(self, columns: Floats) -> tuple[Floats, Floats, Floats]:
        """Make directions (G, K) orthogonal to the unknowns.

        Returns:
            The directions (G, K), their information (K, K) and their score (K,).
        """
        s = self.solved
        inverse = np.linalg.pinv(_scaled(self.S[np.ix_(s, s)])[0], rcond=1e-12, hermitian=True)
        scale = _scaled(self.S[np.ix_(s, s)])[1]
        y = scale[:, None] * (inverse @ (scale[:, None] * (self.S[s] @ columns)))
        W = columns.copy()
        W[s] -= y
        return W, W.T @ self.S @ W, W.T @ self.g

    def derivatives(self, frame: int, W: Floats) -> Floats:
        """Return the change (2, K, N) of a frame's residuals along directions (G, K)."""
        lin, T = _frame(self.result, self.layout, self.state, self.specials, frame)
        moved = self.responses[self.result.problem.layout.surface_of[frame]] @ W
        local = T @ W
        out = np.empty((2, W.shape[1], lin.J_local.shape[2]))
        for first in range(0, out.shape[2], _PIXELS):
            at = slice(first, first + _PIXELS)
            out[:, :, at] = np.einsum("cln,lk->ckn", lin.J_local[:, :, at], local, optimize=True)
            for i in range(3):
                out[:, :, at] -= lin.J_surface[:, i, None, at] * moved[lin.triangles[at, i]].T
        return out

    def all_derivatives(self, W: Floats) -> Iterator[Floats]:
        """Yield the same frame after frame."""
        return (self.derivatives(k, W) for k in range(self.result.problem.layout.frames))


def extend(result: OptimisationResult, rig: Rig, specials: Sequence[Special]) -> Extended:
    """Assemble the normal equations of a fit with every given value and the specials free."""
    old = result.problem.layout
    layout = make_layout(freed(rig, given_blocks(old)), old.frames)
    layout = replace(layout, surface_of=old.surface_of)
    state = widened(result.state, old, layout)
    result.problem.place(result.state)
    normal = NormalEquations.empty(result.problem.surfaces, layout.columns + len(specials))
    solved = _solved(old, layout, len(specials))
    for k, (term, at) in enumerate(
        zip(result.problem.frames, result.evaluation.frames, strict=True)
    ):
        lin, T = _frame(result, layout, state, specials, k)
        normal.add_frame(term.surface, lin, at.residual, result.weights[k], T)
    _add_others(normal, result, solved)
    reduced = normal.reduce()
    eye = np.eye(len(reduced.g))
    responses = [
        response(factor, block.B, eye)
        for factor, block in zip(reduced.factors, normal.surfaces, strict=True)
    ]
    return Extended(result, layout, state, specials, reduced.S, reduced.g, responses, solved)


def _solved(old: Layout, layout: Layout, specials: int) -> NDArray[np.bool_]:
    solved = np.zeros(layout.columns + specials, bool)
    for key, slot in layout.slots.items():
        solved[slot] = key in old.slots
    return solved


def _frame(
    result: OptimisationResult, layout: Layout, state: State, specials: Sequence[Special], k: int
) -> tuple[Linearisation, Floats]:
    """Return a frame's whitened linearisation with the specials, and its tangent map."""
    term: CoordinateTerm = result.problem.frames[k]
    lin = term.renderer.linearise(state, layout)
    further = [special.column(result, k) for special in specials]
    if further:
        lin = replace(lin, J_local=np.concatenate([lin.J_local, np.stack(further, 1)], 1))
    T = layout.local_from_global(state, k)
    n = len(specials)
    T = np.block([[T, np.zeros((len(T), n))], [np.zeros((n, T.shape[1])), np.eye(n)]])
    lin = lin.whitened(term.observed.whitening)
    hit = result.evaluation.frames[k].hits
    return replace(lin, J_local=np.where(hit, lin.J_local, 0.0)), T


def _add_others(
    normal: NormalEquations, result: OptimisationResult, solved: NDArray[np.bool_]
) -> None:
    """Add what costs beside the data: surfaces' smoothness, and priors on the fit's unknowns."""
    own = NormalEquations.empty(result.problem.surfaces, int(solved.sum()))
    for term, part in zip(result.problem.terms, result.evaluation.parts, strict=True):
        if isinstance(term, SmoothnessTerm):
            term.accumulate(normal, part, result.noise)
        elif not isinstance(term, CoordinateTerm):
            term.accumulate(own, part, result.noise)
    at = np.flatnonzero(solved)
    normal.D[np.ix_(at, at)] += own.D
    normal.g[at] += own.g


def _scaled(S: Floats) -> tuple[Floats, Floats]:
    scale = 1 / np.sqrt(np.maximum(np.diag(S), 1e-300))
    return S * np.outer(scale, scale), scale
