"""Recording how an optimisation goes, coarsely, for those who watch."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..records.calibration import Snapshot, TraceRow
from ..records.history import Observe
from .cost.problem import Problem
from .optimise.run import OnIteration
from .unknowns.lattice import Lattice
from .unknowns.state import INTRINSICS, State

VERTICES = 2500
"""Of all surfaces of a snapshot together."""


class History:
    """The snapshots of one optimisation, which may go on with a grown surface."""

    def __init__(self, observe: Observe | None = None) -> None:
        self.snapshots: list[Snapshot] = []
        self._observe = observe
        self._parts: list[tuple[NDArray[np.int64], NDArray[np.float64]]] = []
        self._faces: list[NDArray[np.int64]] = []
        self._before = 0

    def begin(self, problem: Problem, state: State) -> None:
        """Forget what was recorded and start with ``state``."""
        self.snapshots.clear()
        self._before = 0
        self._set_meshes(problem)
        self._add(0, None, None, state)

    def go_on(self, problem: Problem) -> None:
        """Continue with other surfaces; iterations are counted on."""
        self._before = self.snapshots[-1].iteration
        self._set_meshes(problem)

    def recording(self, report: OnIteration) -> OnIteration:
        """Return a callback that records an iteration and then reports it."""

        def record(row: TraceRow, state: State) -> None:
            row = replace(row, iteration=self._before + row.iteration)
            self._add(row.iteration, row.cost, row.scale_px, state)
            report(row, state)

        return record

    def _set_meshes(self, problem: Problem) -> None:
        room = max(VERTICES // len(problem.surfaces), 100)
        coarse = [coarsened(s.lattice, room) for s in problem.surfaces]
        directions = [s.lattice.directions for s in problem.surfaces]
        self._parts = [(kept, d[kept]) for (kept, _), d in zip(coarse, directions, strict=True)]
        self._faces = [faces for _, faces in coarse]

    def _add(
        self, iteration: int, cost: float | None, scale_px: float | None, state: State
    ) -> None:
        snapshot = Snapshot(
            iteration=iteration,
            cost=cost,
            scale_px=scale_px,
            focal=[float(np.exp(v[INTRINSICS["focal"]][0])) for v in state.intrinsics],
            surfaces=[
                directions / rho[kept][:, None]
                for (kept, directions), rho in zip(self._parts, state.rho, strict=True)
            ],
            faces=self._faces,
            world_from_camera=state.world_from_camera,
            projector_from_camera=state.projector_from_camera,
        )
        self.snapshots.append(snapshot)
        if self._observe is not None:
            self._observe(snapshot)


def coarsened(lattice: Lattice, room: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return every n-th vertex of a lattice, at most ``room`` or so, and triangles over them.

    Returns:
        (K,) indices of the vertices kept, and (F, 3) triangles of indices into those. A square of
        the coarse lattice is covered where its four corners exist.
    """
    step = max(1, int(np.ceil(np.sqrt(lattice.size / room))))
    low = lattice.ij.min(0)
    kept = np.flatnonzero(((lattice.ij - low) % step == 0).all(1))
    column, row = ((lattice.ij[kept] - low) // step).T
    index = np.full((row.max() + 2, column.max() + 2), -1)
    index[row, column] = np.arange(len(kept))
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    whole = (a >= 0) & (b >= 0) & (c >= 0) & (d >= 0)
    a, b, c, d = (corner[whole] for corner in (a, b, c, d))
    return kept, np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
