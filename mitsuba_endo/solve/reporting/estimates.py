"""From a fit to the estimates of its unknowns, with their standard deviations and statuses."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...geometry.transforms import RigidTransform
from ...initialisation.alternative_poses import AlternativePose
from ...records.solution import Estimate, Outcome, PoseEstimate, Status
from ..inference.alternative_solutions import AMBIGUOUS, ambiguities
from ..inference.fit import Fit
from ..inference.model_error.analysis import with_effect
from ..inference.observability import (
    Direction,
    Unknown,
    advice,
    free_directions,
    is_flat,
    problem_unknowns,
    status_of,
)
from ..unknowns.block import BLOCKS, VectorBlock
from ..unknowns.layout import Layout
from .scale import Unit

Floats = NDArray[np.float64]

UNSETTLED = "the optimisation had not converged"
"""Why a value with a small standard deviation is weak."""
STRUCTURED = "the residuals hold structure that the model does not explain, see Model"
"""Why one that the relief would determine is weak."""
_LISTED = 4
"""Items that a sentence lists."""


@dataclass(frozen=True, eq=False)
class Estimates:
    """What a fit says of its unknowns, in the solution's unit."""

    fit: Fit
    unit: Unit

    @property
    def layout(self) -> Layout:
        return self.fit.problem.layout

    @cached_property
    def names(self) -> list[Unknown]:
        """The global unknowns in the order of their columns."""
        return problem_unknowns(self.fit.problem, self.fit.state)

    @cached_property
    def covariance(self) -> Floats:
        """(G, G) formal one, times the design effect of the residuals, with what errors of the
        given values add, and scaled so that no variance is below the jackknife's.
        """
        formal, model = self.fit.uncertainty.formal, self.fit.model
        if model is not None:
            formal = with_effect(self.fit.reported, formal, model.effect)
            formal = formal if model.added is None else formal + model.added
        variance = np.diag(formal)
        largest = np.max([variance, *jackknife_variances(self.fit)], axis=0)
        root = np.sqrt(largest / np.maximum(variance, 1e-300))
        return formal * np.outer(root, root)

    @cached_property
    def directions(self) -> list[Direction]:
        """Directions that the data leave weak or free, worst first."""
        return free_directions(self.covariance, self.names)

    @cached_property
    def alternatives(self) -> list[tuple[list[int], AlternativePose]]:
        """Other projector poses that fit, with their frames."""
        determined = [
            all(
                slot is None or self.status(slot) != "unobservable"
                for slot in (self.layout.slot(b, k) for b in ("projector_pose", "focal"))
            )
            for k in range(self.layout.frames)
        ]
        uncertainty, reported = self.fit.uncertainty, self.fit.reported
        return ambiguities(reported, uncertainty.sigma, self.covariance, determined)

    def status(self, slot: slice) -> Status:
        """Return the status of a block with the unknowns at ``slot``.

        Nothing is measured before the optimisation has settled; and what is weak then may be on
        its way along a valley that has no end.
        """
        worst, outcome = self._worst(slot), self.fit.result.outcome
        model = self.fit.model
        if worst == "measured" and model is not None and model.unexplained:
            return "weak"
        if outcome is Outcome.CONVERGED or worst == "unobservable":
            return worst
        ended = outcome in (Outcome.STALLED, Outcome.MAX_ITERATIONS)
        return "unobservable" if worst == "weak" and ended else "weak"

    def vector(self, name: str, frame: int) -> Estimate:
        """Return the estimate of an array, null where the data do not determine it."""
        block = _vector_block(name)
        value, slot = self.fit.estimate.at(name, frame), self.layout.slot(name, frame)
        reported = block.reported(value)
        if slot is None:
            return Estimate(value=_plain(block, reported), status="fixed")
        slope = np.abs(block.reported_slope(value))
        jackknives = jackknife_variances(self.fit)
        deviations = [np.diag(self.covariance), np.diag(self.fit.uncertainty.formal)]
        largest, formal = (np.sqrt(v[slot]) * slope for v in deviations)
        status = self.status(slot)
        return Estimate(
            value=None if status == "unobservable" else _plain(block, reported),
            std=_plain(block, largest),
            std_formal=_plain(block, formal),
            std_jackknife=_plain(block, np.sqrt(np.max(jackknives, axis=0)[slot]) * slope)
            if jackknives
            else None,
            status=status,
            reason=None if status == "measured" else self._reason(name, frame, slot),
        )

    def pose(self, name: str, frame: int) -> PoseEstimate:
        """Return the estimate of a pose, null where the data do not determine it."""
        own, slot = self.fit.estimate.at(name, frame), self.layout.slot(name, frame)
        pose = self.unit.pose(own)
        if slot is None:
            return PoseEstimate.of(pose, std=[0.0] * 6, status="fixed")
        status = self.status(slot)
        reason = None if status == "measured" else self._reason(name, frame, slot)
        if status == "unobservable":
            return PoseEstimate(R=None, t=None, status=status, reason=reason)
        if name == "projector_pose" and self._ambiguous(frame):
            status, reason = "weak", f"{AMBIGUOUS}; {reason}" if reason else AMBIGUOUS
        uncertainty = self.fit.uncertainty
        jackknives = [
            c for c in (uncertainty.jackknife, uncertainty.frame_jackknife) if c is not None
        ]
        candidates = [self._pose_std(name, frame, own, c) for c in jackknives]
        covariance = self._pose_covariance(name, frame, own, self.covariance)
        return PoseEstimate.of(
            pose,
            std=_deviations(covariance),
            covariance=covariance.tolist(),
            std_formal=self._pose_std(name, frame, own, uncertainty.formal),
            std_jackknife=[float(x) for x in np.max(candidates, axis=0)] if candidates else None,
            status=status,
            reason=reason,
        )

    def _worst(self, slot: slice) -> Status:
        """Return the status that the least known unknown at ``slot`` has by its deviation."""
        deviations = np.sqrt(np.diag(self.covariance))[slot]
        names = self.names[slot]
        return status_of(max(float(d) / n.scale for d, n in zip(deviations, names, strict=True)))

    def _noise_allows(self, slot: slice) -> bool:
        """Tell whether a block would be measured if noise were all that the residuals hold."""
        std = np.sqrt(np.diag(self.fit.uncertainty.formal))[slot]
        scales = [n.scale for n in self.names[slot]]
        return status_of(float(np.max(std / scales))) == "measured"

    def _ambiguous(self, frame: int) -> bool:
        """Tell whether the residuals cannot choose between this frame's pose and another."""
        return any(
            frame in frames and not alternative.decided for frames, alternative in self.alternatives
        )

    def _reason(self, name: str, frame: int, slot: slice) -> str:
        """Say why a block is not measured, and what would help."""
        if self._worst(slot) == "measured":
            settled = self.fit.result.outcome is Outcome.CONVERGED
            return STRUCTURED if settled else UNSETTLED
        if self.fit.model is not None and self.fit.model.wrong and self._noise_allows(slot):
            return STRUCTURED
        (surface, *_), (values, *_) = self.fit.problem.surfaces, self.fit.state.surfaces
        flat = is_flat(surface.vertices(values))
        mine = {n.words for n in self.names[slot]}
        for direction in self.directions:
            if mine & set(direction.mixes):
                blocks = {n.block for n in self.names if n.words in direction.mixes}
                others = [m for m in direction.mixes if m not in mine]
                mixed = f"it cannot be separated from {listed(others)}: " if others else ""
                return mixed + advice(blocks, self.fit.law, flat)
        return advice({name}, self.fit.law, flat)

    def _pose_std(
        self, name: str, frame: int, own: RigidTransform, covariance: Floats
    ) -> list[float]:
        return _deviations(self._pose_covariance(name, frame, own, covariance))

    def _pose_covariance(
        self, name: str, frame: int, own: RigidTransform, covariance: Floats
    ) -> Floats:
        """Return (6, 6), radians and the solution's unit, whose own error moves translations."""
        state, layout = self.fit.state, self.layout
        T = layout.local_from_global(state, frame)[layout.rows(name, frame)]
        shared = np.concatenate([np.zeros(3), own.t * self.unit.std_relative])
        lengths = np.repeat([1.0, self.unit.factor], 3)
        return (T @ covariance @ T.T + np.outer(shared, shared)) * np.outer(lengths, lengths)


def jackknife_variances(fit: Fit) -> list[Floats]:
    """Return the variances (G,) of every jackknife that was computed."""
    uncertainty = fit.uncertainty
    return [
        np.diag(c) for c in (uncertainty.jackknife, uncertainty.frame_jackknife) if c is not None
    ]


def inflation(fit: Fit) -> float:
    """Return by how much standard deviations exceed the formal ones, at least 1."""
    formal = np.diag(fit.uncertainty.formal)
    ratios = [np.median(v / formal) for v in jackknife_variances(fit) if len(v)]
    effect = 1.0 if fit.model is None else fit.model.effect
    return float(np.sqrt(max([1.0, effect, *ratios])))


def _deviations(covariance: Floats) -> list[float]:
    return [float(x) for x in np.sqrt(np.maximum(np.diag(covariance), 0.0))]


def listed(items: Sequence[str]) -> str:
    """Return items as people list them; of many the first ones and how many more there are."""
    if len(items) > _LISTED + 1:
        items = [*items[:_LISTED], f"{len(items) - _LISTED} more"]
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def _vector_block(name: str) -> VectorBlock:
    block = BLOCKS[name]
    assert isinstance(block, VectorBlock)
    return block


def _plain(block: VectorBlock, values: Floats) -> float | list[float]:
    """Return a number for blocks that are one, else a list."""
    single = block.part_names == ("",) and len(values) == 1
    return float(values[0]) if single else [float(v) for v in values]
