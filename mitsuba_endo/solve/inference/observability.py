"""What the data determine, in words.

Every unknown has a scale at which its error would spoil a measurement; standard deviations are
compared with it. Directions in the space of unknowns along which nothing is known are named by
the unknowns that they mix.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...records.solution import Status
from ..costs.objective import Problem
from ..unknowns.block import BLOCKS, NaturalScales
from ..unknowns.layout import Layout
from ..unknowns.state import State

WEAK, UNOBSERVABLE = 0.01, 0.1
"""Standard deviations, in natural scales, from which on an unknown is weak or unobservable."""
_MIXED = 0.25
"""Share of the largest component from which on an unknown counts as part of a direction."""
_DRAGGED = 0.05
"""The same for an unknown that the direction alone makes weak."""
_FLAT = 0.02
"""Depth relief over lateral extent below which a surface counts as nearly planar."""
_MAX_CORRELATED = 60
"""Unknowns up to which their correlations are recorded; more cannot be looked at."""


@dataclass(frozen=True)
class Unknown:
    """One scalar of the global unknowns."""

    block: str
    owner: int
    part: str
    """Its name inside the block, e.g. ``rotation about x``."""
    scale: float
    """Natural scale: the change that spoils a measurement if it is an error."""
    several: bool = False
    """Whether frames have values of their own."""

    @property
    def words(self) -> str:
        """Its name for people."""
        name = BLOCKS[self.block].words
        name = f"{name} ({self.part})" if self.part else name
        return f"{name} of frame {self.owner + 1}" if self.several else name


@dataclass(frozen=True)
class Direction:
    """A direction in the space of unknowns that the data leave (nearly) free."""

    std: float
    """Standard deviation along it, in natural scales."""
    mixes: list[str]
    """The unknowns that move together."""


def unknowns(
    layout: Layout, state: State, distance: float, camera_focal: float = 1.0
) -> list[Unknown]:
    """List the global unknowns in the order of their columns.

    Args:
        layout: of the unknowns.
        state: their values.
        distance: of the surface, baselines.
        camera_focal: focal length of the camera, pixels.
    """
    out: list[Unknown] = []
    for (name, owner), slot in layout.slots.items():
        block, value = BLOCKS[name], state.values[name][owner]
        focal = state.focals[layout.owners[name].index(owner)]
        scene = NaturalScales(distance, focal, camera_focal)
        scales = block.scales(value, scene)[: slot.stop - slot.start]
        parts = layout.gauge.names(name, owner, layout.names[name])
        several = layout.sharing(name) == "per_frame"
        out += [
            Unknown(name, owner, part, float(scale), several)
            for part, scale in zip(parts, scales, strict=True)
        ]
    return out


def problem_unknowns(problem: Problem, state: State) -> list[Unknown]:
    """List the global unknowns of a problem."""
    distance = problem.surfaces[0].typical_range(state.surfaces[0])
    camera_focal = float(problem.observed[0].camera.K[0][0])
    return unknowns(problem.layout, state, distance, camera_focal)


def status_of(std: float) -> Status:
    """Return how well an unknown with standard deviation ``std``, in natural scales, is known."""
    if not std < UNOBSERVABLE:
        return "unobservable"
    return "weak" if std >= WEAK else "measured"


def free_directions(covariance: NDArray[np.float64], names: list[Unknown]) -> list[Direction]:
    """Return the directions that are weak or unobservable, worst first."""
    if not len(names):
        return []
    scale = np.array([u.scale for u in names])
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    out = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        std = float(np.sqrt(max(value, 0.0)))
        if std < WEAK:
            break
        share = np.abs(vector) / np.abs(vector).max()
        order = np.argsort(-share)
        least = np.where(np.abs(vector) * std >= WEAK, _DRAGGED, _MIXED)
        mixes = [names[i].words for i in order if share[i] > least[i]]
        out.append(Direction(std, mixes))
    return out


def correlation(covariance: NDArray[np.float64], names: list[Unknown]) -> dict[str, Any] | None:
    """Return the correlation matrix of the unknowns for the record, or None above 60 unknowns.

    Entries of unknowns without a finite positive variance are None.
    """
    if not 0 < len(names) <= _MAX_CORRELATED:
        return None
    with np.errstate(all="ignore"):
        std = np.sqrt(np.diag(covariance))
        matrix = covariance / np.outer(std, std)
    has_variance = np.isfinite(std) & (std > 0)
    finite = np.isfinite(matrix) & np.outer(has_variance, has_variance)
    rounded = np.round(np.where(finite, matrix, 0.0), 4).tolist()
    entries = [
        [value if is_finite else None for value, is_finite in zip(*row, strict=True)]
        for row in zip(rounded, finite.tolist(), strict=True)
    ]
    return {"unknowns": [n.words for n in names], "matrix": entries}


def advice(blocks: set[str], law: str, flat: bool) -> str:
    """Say why these blocks cannot be told apart, and what would help."""
    if "centre" in blocks and "focal" in blocks:
        return (
            "the projector's centre and focal length shift the pattern alike; fix the centre at "
            "its design value"
        )
    if "focal" in blocks and law == "pinhole" and flat:
        return (
            "the surface is nearly planar, and a plane does not show the focal length of a "
            "pinhole projector; add a frame that sees relief, or fix the focal length"
        )
    if "focal" in blocks:
        return "the relief is too small for it; add a frame that sees more depth, or fix it"
    if "camera_pose" in blocks:
        return "the frames see too little common relief; add overlap or relief"
    return "the relief seen is too small; add a frame that sees more depth"


def is_flat(points: NDArray[np.float64]) -> bool:
    """Tell whether points (N, 3) lie nearly in one plane."""
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spread[2] < _FLAT * spread[1])


def describe(directions: list[Direction]) -> list[dict[str, Any]]:
    """Return the free directions for ``solution.json``."""
    return [{"std": d.std, "mixes": d.mixes} for d in directions]
