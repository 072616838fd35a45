"""Recording how an optimisation goes, coarsely, for those who watch."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..records.calibration import Snapshot, TraceRow
from ..records.history import Observe
from .costs.objective import Problem
from .minimisers.minimise import OnIteration
from .surfaces.surface import Surface
from .unknowns.state import State

VERTICES = 2500
"""Of all surfaces of a snapshot together."""


class History:
    """The snapshots of one optimisation, which may go on with a grown surface."""

    def __init__(self, observe: Observe | None = None) -> None:
        self.snapshots: list[Snapshot] = []
        self._observe = observe
        self._parts: list[tuple[Surface, NDArray[np.int64]]] = []
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
        coarse = [s.coarsened(room) for s in problem.surfaces]
        self._parts = [(s, kept) for s, (kept, _) in zip(problem.surfaces, coarse, strict=True)]
        self._faces = [faces for _, faces in coarse]

    def _add(
        self, iteration: int, cost: float | None, scale_px: float | None, state: State
    ) -> None:
        snapshot = Snapshot(
            iteration=iteration,
            cost=cost,
            scale_px=scale_px,
            focal=state.focals,
            surfaces=[
                surface.vertices(values)[kept]
                for (surface, kept), values in zip(self._parts, state.surfaces, strict=True)
            ],
            faces=self._faces,
            world_from_camera=state.camera_poses,
            projector_from_camera=state.projector_poses,
        )
        self.snapshots.append(snapshot)
        if self._observe is not None:
            self._observe(snapshot)
