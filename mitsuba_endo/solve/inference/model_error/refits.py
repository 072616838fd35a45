"""Solving anew with one candidate free: what a linear prediction cannot rank after a gross error.

Done on a sample of the epipolar residuals. A refit has one further unknown, the candidate's own, so
that what they reach can be compared; the other projection model has none; the camera's matrix and
its distortion as a whole have several, and come after single ones that explain as much.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....geometry.projection_models import PROJECTION_MODELS
from ....geometry.transforms import RigidTransform
from ....records.rig import Rig
from ...minimisers.result import OptimisationResult
from ...unknowns.block import BLOCKS
from ...unknowns.layout import Layout, make_layout
from ...unknowns.state import State
from .epipolar_fit import possible
from .epipolar_solve import (
    EpipolarSample,
    ModelVariant,
    Point,
    noise_of,
    point_at,
    robust_cost,
    sampled,
    solved,
)
from .extended import freed, given_blocks, widened
from .sharing_tests import alternatives

Floats = NDArray[np.float64]

PLAN = "plan."
"""Beginning of the keys of values that frames share and that each may have for itself."""
MATRIX = "camera_matrix"
"""Key of focal length and centre of the camera together, as of another resolution or a crop."""
LENS = "camera_distortion"
WHOLE = (LENS, "centre", "camera_focal")
"""Blocks whose parts are also freed together."""
PIXELS = 700
"""In the sample of all frames together, about."""
_LIKELY = 5
"""Ways that are tried because score tests put them first."""
_FOCAL = "camera_focal.focal"
_MISJUDGED = (
    _FOCAL, "camera_focal.aspect", "camera_centre.x", "camera_centre.y", "centre.x", "centre.y",
    MATRIX, *WHOLE,
)  # fmt: skip
AS_GOOD = 0.9
"""Share of the best refit's gain from which on another explains the residuals as well."""
_HEAT, _FINALISTS, _FINAL = 4, 4, 16
"""Iterations of every variant, how many of the best go on, and for how many more."""
_LOST = (_FOCAL, MATRIX, LENS, f"{LENS}.k1")
"""Ways that begin far from the fit too, after gross errors; another projection model does so."""
_SIDES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, -1.0, 0.0))
"""Directions in which the projector may stand; opposite ones have the same residuals."""
_FAR_HEAT = 8
"""Iterations of variants that begin far from the fit, before they are compared. Chosen."""


@dataclass(frozen=True, eq=False)
class Refit:
    """Where a candidate led."""

    variant: ModelVariant
    value: float
    """By how much the given value is off, in the candidate's unit; 1 for what has none."""
    gain: float
    """Fall of the robust cost, in noise variances of the best refit."""
    shift: Floats | None
    """(G,) by how much the fit's unknowns moved; None where they are others."""
    left: float
    """Share of the residuals' energy that it leaves."""
    end: State
    """Of unknowns and given values, where it ended."""


def variants(layout: Layout, rig: Rig, law: str) -> list[ModelVariant]:
    """Return everything that can be tried for a fit."""
    given = given_blocks(layout)
    wide = make_layout(freed(rig, given), layout.frames)
    out = [
        ModelVariant(f"{name}.{s.part}" if s.part else name, law, [(name, s.step)])
        for name in given
        for s in BLOCKS[name].suspects(wide.names[name])
    ]
    if {"camera_focal", "camera_centre"} <= set(given):
        ends = [("camera_focal", np.full(2, 0.01))]
        out.append(
            ModelVariant(MATRIX, law, [*ends, *(("camera_centre", axis) for axis in np.eye(2))])
        )
    out += [
        ModelVariant(name, law, [(name, axis) for axis in np.eye(len(wide.names[name]))])
        for name in WHOLE if name in given
    ]  # fmt: skip
    out += [ModelVariant(f"law.{other}", other) for other in PROJECTION_MODELS if other != law]
    return out + [
        ModelVariant(f"{PLAN}{name}", law, (), plan) for name, plan in alternatives(layout, rig)
    ]


def worth_trying(layout: Layout, rig: Rig, law: str, order: Sequence[str]) -> list[ModelVariant]:
    """Return the variants that score tests put first, and those misjudged after gross errors.

    Args:
        layout: of the fit.
        rig: of it.
        law: of it.
        order: keys of the candidates, the most explaining first.
    """
    by_key = {variant.key: variant for variant in variants(layout, rig, law)}
    first = [key for key in order if key in by_key][:_LIKELY]
    others = [
        key
        for key, variant in by_key.items()
        if key in _MISJUDGED or variant.law != law or variant.layout is not None
    ]
    return [by_key[key] for key in dict.fromkeys([*first, *others])]


def refits(
    result: OptimisationResult,
    rig: Rig,
    tried: Sequence[ModelVariant],
    *,
    far: bool = False,
    pixels: int = PIXELS,
) -> list[Refit]:
    """Solve anew with each of the variants free.

    Args:
        result: the fit.
        rig: of it.
        tried: the variants.
        pixels: in the sample of all frames together, about.
        far: whether gross errors may have led the fit far from where it should be.

    Returns:
        The best first; among those that explain as much, the simplest.
    """
    problem, layout = result.problem, result.problem.layout
    if not possible(problem, result.state):
        return []
    sample = sampled(result, rig, pixels)
    none = ModelVariant("", problem.law)
    base = solved(sample, none, point_at(sample, none, result.state), _FINAL)
    ends = _race(sample, tried, base, far)
    sigma = min([noise_of(base.r), *(noise_of(end.r) for _, end in ends)])
    before = noise_of(base.r)
    out = [
        Refit(
            variant, float(end.amounts[0]) if len(end.amounts) else 1.0,
            robust_cost(base.r, sigma) - robust_cost(end.r, sigma),
            layout.difference(base.state, end.state) if variant.layout is None else None,
            min((noise_of(end.r) / before) ** 2, 1.0), end.state,
        )
        for variant, end in ends
    ]  # fmt: skip
    best = max((r.gain for r in out), default=0.0)
    return sorted(out, key=lambda r: (len(r.variant.steps), -r.gain) if r.gain >= AS_GOOD * best
                  else (np.inf, -r.gain))  # fmt: skip


def _race(
    sample: EpipolarSample, tried: Sequence[ModelVariant], base: Point, far: bool
) -> list[tuple[ModelVariant, Point]]:
    """Return where variants end, those that are behind after some iterations left out."""
    heats: dict[str, tuple[ModelVariant, Point]] = {}
    for variant in tried:
        starts = _starts(sample, variant, base, far)
        heat = _HEAT if len(starts) == 1 else _FAR_HEAT
        ends = [solved(sample, variant, start, heat) for start in starts]
        heats[variant.key] = (
            variant,
            min(ends, key=lambda end: robust_cost(end.r, noise_of(base.r))),
        )
    sigma = min([noise_of(base.r), *(noise_of(end.r) for _, end in heats.values())])
    order = sorted(heats.values(), key=lambda e: robust_cost(e[1].r, sigma))
    return [
        (variant, solved(sample, variant, end, _FINAL))
        for i, (variant, end) in enumerate(order)
        if i < _FINALISTS
        or variant.key in (MATRIX, LENS, _FOCAL)
        or variant.law != base.frames[0].law
    ]


def _starts(sample: EpipolarSample, variant: ModelVariant, base: Point, far: bool) -> list[Point]:
    """Return where a variant begins: after gross errors also far from where the fit was led to."""
    state = base.state
    if variant.layout is not None:
        state = widened(state, sample.layout, variant.layout)
    lost = far and (variant.law != base.frames[0].law or variant.key in _LOST)
    return [
        point_at(sample, variant, s) for s in (state, *(_sideways(sample, base) if lost else ()))
    ]


def _sideways(sample: EpipolarSample, base: Point) -> Iterator[State]:
    """Yield states whose projectors stand beside the camera, as they do in endoscopes.

    Their rotations are the fit's, which gross errors turn by a few degrees only; translation and
    focal length they may lead anywhere.
    """
    if not (sample.layout.free["focal"] and sample.layout.free["projector_pose"]):
        return
    state = base.state
    focal = (np.log([_extent(sample)]),) * len(state.values["focal"])
    for side in _SIDES:
        t = np.array(side) / np.linalg.norm(side)
        poses = tuple(
            RigidTransform(pose.R, float(np.linalg.norm(pose.t)) * t)
            for pose in state.values["projector_pose"]
        )
        yield replace(state, values={**state.values, "focal": focal, "projector_pose": poses})


def _extent(sample: EpipolarSample) -> float:
    """Return the size of what was seen of the pattern, pattern pixels."""
    return max(float(np.ptp(o.q, axis=1).max()) for o in sample.observed)
