"""Solving anew with one candidate free: what a linear prediction cannot rank after a gross error.

Done on a sample of the epipolar residuals. A refit has one further unknown, the candidate's own, so
that what they reach can be compared; the other projection model has none; the camera's matrix and
its distortion as a whole have several, and come after single ones that explain as much.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....geometry.projection_models import PROJECTION_MODELS
from ....geometry.transforms import RigidTransform
from ....initialisation.correspondences import Correspondences
from ....initialisation.relative_pose_ransac import propose
from ....records.rig import Rig
from ....robust import MAD_TO_STD
from ...costs.coordinate_residual import Observations
from ...minimisers.result import OptimisationResult
from ...unknowns.block import BLOCKS
from ...unknowns.layout import Layout, make_layout
from ...unknowns.state import State
from .epipolar_fit import Look, along, derivatives, look, possible, thinned
from .extended import freed, given_blocks, widened
from .sharing_tests import alternatives

Floats = NDArray[np.float64]

PLAN = "plan."
"""Beginning of the keys of values that frames share and that each may have for itself."""
MATRIX = "camera_matrix"
"""Key of focal length and centre of the camera together, as of another resolution or a crop."""
LENS = "camera_distortion"
WHOLE = (LENS, "centre")
"""Blocks whose parts are also freed together."""
PIXELS = 700
"""In the sample of all frames together, about."""
_LIKELY = 5
"""Ways that are tried because score tests put them first."""
_FOCAL = "camera_focal.focal"
_MISJUDGED = (_FOCAL, "camera_centre.x", "camera_centre.y", "centre.x", "centre.y", MATRIX, *WHOLE)
AS_GOOD = 0.9
"""Share of the best refit's gain from which on another explains the residuals as well."""
_HEAT, _FINALISTS, _FINAL = 4, 4, 16
"""Iterations of every way, how many of the best go on, and for how many more."""
_TRIES = 4
"""Dampings tried for a step before a refit ends where it is. Chosen."""
_SPREAD, _RANKS, _FEW = (0.8, 1.2, 2.0), 2, 300
"""Focal lengths, in extents of what was seen of the pattern, from which another projection model
is tried, how many poses each, and how many correspondences propose them."""
_SETTLED = 1e-3
"""Relative fall of the cost at which a refit ends."""
_SETTLED_NOISE = 0.99
"""A noise that falls to no less than this share of itself in a step has settled. Chosen."""
_DAMPING = (1e-4, 10.0, 0.1)
"""First one, and the factors after a failed and a successful step."""
_CAUCHY = 2.5
"""Scale of the robust loss in noise standard deviations."""
_FAR = 100.0
"""Deviations that count for a pixel without a residual."""


@dataclass(frozen=True, eq=False)
class Way:
    """One thing to free: directions of given values, or another projection model."""

    key: str
    law: str
    steps: Sequence[tuple[str, Floats]] = ()
    """(block, step of its value by one unit of the candidate)."""
    layout: Layout | None = None
    """Another plan of sharing; None for that of the fit."""


@dataclass(frozen=True, eq=False)
class Refit:
    """Where a candidate led."""

    way: Way
    value: float
    """By how much the given value is off, in the candidate's unit; 1 for what has none."""
    gain: float
    """Fall of the robust cost, in noise variances of the best refit."""
    shift: Floats | None
    """(G,) by how much the fit's unknowns moved; None where they are others."""
    left: float
    """Share of the residuals' energy that it leaves."""


@dataclass(frozen=True, eq=False)
class _Sample:
    """What a refit looks at: a part of every frame's pixels."""

    layout: Layout
    observed: Sequence[Observations]
    given: dict[str, Floats]


@dataclass(frozen=True, eq=False)
class _Point:
    """Where a refit stands."""

    state: State
    amounts: Floats
    """(K,) of the directions that are free."""
    looks: list[Look]

    @property
    def r(self) -> Floats:
        """(N,) residuals of all frames."""
        return np.concatenate([at.r for at in self.looks])


def ways(layout: Layout, rig: Rig, law: str) -> list[Way]:
    """Return everything that can be tried for a fit."""
    given = given_blocks(layout)
    wide = make_layout(freed(rig, given), layout.frames)
    out = [
        Way(f"{name}.{s.part}" if s.part else name, law, [(name, s.step)])
        for name in given
        for s in BLOCKS[name].suspects(wide.names[name])
    ]
    if {"camera_focal", "camera_centre"} <= set(given):
        ends = [("camera_focal", np.full(2, 0.01))]
        out.append(Way(MATRIX, law, [*ends, *(("camera_centre", axis) for axis in np.eye(2))]))
    out += [
        Way(name, law, [(name, axis) for axis in np.eye(len(wide.names[name]))])
        for name in WHOLE if name in given
    ]  # fmt: skip
    out += [Way(f"law.{other}", other) for other in PROJECTION_MODELS if other != law]
    return out + [Way(f"{PLAN}{name}", law, (), plan) for name, plan in alternatives(layout, rig)]


def worth_trying(layout: Layout, rig: Rig, law: str, order: Sequence[str]) -> list[Way]:
    """Return the ways that score tests put first, and those that they misjudge after gross errors.

    Args:
        layout: of the fit.
        rig: of it.
        law: of it.
        order: keys of the candidates, the most explaining first.
    """
    found = {way.key: way for way in ways(layout, rig, law)}
    first = [key for key in order if key in found][:_LIKELY]
    others = [
        key
        for key, way in found.items()
        if key in _MISJUDGED or way.law != law or way.layout is not None
    ]
    return [found[key] for key in dict.fromkeys([*first, *others])]


def refits(
    result: OptimisationResult, rig: Rig, tried: Sequence[Way], *, far: bool = False
) -> list[Refit]:
    """Solve anew with each of the ways free.

    Args:
        result: the fit.
        rig: of it.
        tried: the ways.
        far: whether the fit may be far from what another projection model leads to.

    Returns:
        The best first; among those that explain as much, the simplest.
    """
    problem, layout = result.problem, result.problem.layout
    if not possible(problem, result.state):
        return []
    wide = make_layout(freed(rig, given_blocks(layout)), layout.frames)
    stride = max(1, round(np.sqrt(problem.observations / PIXELS)))
    sample = _Sample(layout, [thinned(o, stride) for o in problem.observed],
                     {n: v for n, v in wide.given.items() if v is not None})  # fmt: skip
    none = Way("", problem.law)
    base = _solved(sample, none, _at(sample, none, result.state), _FINAL)
    ends = _race(sample, tried, base, far)
    sigma = min([_noise(base.r), *(_noise(end.r) for _, end in ends)])
    before = _noise(base.r)
    out = [
        Refit(
            way, float(end.amounts[0]) if len(end.amounts) else 1.0,
            _cost(base.r, sigma) - _cost(end.r, sigma),
            layout.difference(base.state, end.state) if way.layout is None else None,
            min((_noise(end.r) / before) ** 2, 1.0),
        )
        for way, end in ends
    ]  # fmt: skip
    best = max((r.gain for r in out), default=0.0)
    return sorted(out, key=lambda r: (len(r.way.steps), -r.gain) if r.gain >= AS_GOOD * best
                  else (np.inf, -r.gain))  # fmt: skip


def _race(
    sample: _Sample, tried: Sequence[Way], base: _Point, far: bool
) -> list[tuple[Way, _Point]]:
    """Return where ways end, those that are behind after some iterations left out."""
    heats: dict[str, tuple[Way, _Point]] = {}
    for way in tried:
        ends = [_solved(sample, way, start, _HEAT) for start in _starts(sample, way, base, far)]
        heats[way.key] = way, min(ends, key=lambda end: _cost(end.r, _noise(base.r)))
    sigma = min([_noise(base.r), *(_noise(end.r) for _, end in heats.values())])
    order = sorted(heats.values(), key=lambda e: _cost(e[1].r, sigma))
    return [
        (way, _solved(sample, way, end, _FINAL))
        for i, (way, end) in enumerate(order)
        if i < _FINALISTS or way.key in (MATRIX, LENS, _FOCAL) or way.law != base.looks[0].law
    ]


def _starts(sample: _Sample, way: Way, base: _Point, far: bool) -> list[_Point]:
    """Return where a way begins: another projection model from poses of its own too."""
    state = base.state
    if way.layout is not None:
        state = widened(state, sample.layout, way.layout)
    if way.law == base.looks[0].law or not far:
        return [_at(sample, way, state)]
    return [_at(sample, way, s) for s in (state, *_proposed(sample, way.law, base))]


def _proposed(sample: _Sample, law: str, base: _Point) -> list[State]:
    """Return states with the poses that five points each propose under a projection model.

    The focal length of another model may have led far away from its own.
    """
    free = sample.layout.free["focal"] and sample.layout.free["projector_pose"]
    ways_on = [(focal, rank) for focal in _focals(sample) for rank in range(_RANKS)]
    return [_proposal(sample, law, base, *way) for way in ways_on] if free else []


def _focals(sample: _Sample) -> list[float]:
    """Return focal lengths that spread what was seen of the pattern over usual angles."""
    extent = max(float(np.ptp(o.q, axis=1).max()) for o in sample.observed)
    return [share * extent for share in _SPREAD]


def _proposal(sample: _Sample, law: str, base: _Point, focal: float, rank: int) -> State:
    state, owners = base.state, sample.layout.owners["projector_pose"]
    values = {"focal": tuple(np.log([focal]) for _ in state.values["focal"])}
    poses = list(state.values["projector_pose"])
    for owner in set(owners):
        k = owners.index(owner)
        at, observed = base.looks[k], sample.observed[k]
        model = state.projector(k, observed.camera, law)
        assert model is not None  # see `possible`
        data = Correspondences(np.arange(observed.count), _unit(at.rays), observed.q)
        few = data.take(np.arange(0, len(data), max(1, len(data) // _FEW)))
        found = propose(few, model, np.array([focal]))
        if found:
            length = float(np.linalg.norm(poses[owner].t))
            pose = found[min(rank, len(found) - 1)].pose
            poses[owner] = RigidTransform(pose.R, length * pose.t)
    return replace(state, values={**state.values, **values, "projector_pose": tuple(poses)})


def _unit(rays: Floats) -> Floats:
    return rays / np.linalg.norm(rays, axis=0)


def _solved(sample: _Sample, way: Way, now: _Point, iterations: int) -> _Point:
    """Minimise by Levenberg-Marquardt on reweighted least squares, the scale falling along."""
    mu, up, down = _DAMPING
    sigma = _noise(now.r)
    for _ in range(iterations):
        J, r, cost = _jacobian(sample, way, now), np.nan_to_num(now.r), _cost(now.r, sigma)
        w = np.where(np.isfinite(now.r), 1 / (1 + (r / (_CAUCHY * sigma)) ** 2), 0.0)
        H, g = (J * w) @ J.T, (J * w) @ r
        for _ in range(_TRIES):
            trial = _moved(sample, way, now, _damped(H, g, mu))
            gained = cost - _cost(trial.r, sigma)
            if gained >= 0:
                break
            mu *= up
        else:
            break
        mu, now = mu * down, trial
        followed = min(sigma, _noise(now.r))
        if gained < _SETTLED * cost and followed > _SETTLED_NOISE * sigma:
            break
        sigma = followed
    return now


def _damped(H: Floats, g: Floats, mu: float) -> Floats:
    scale = 1 / np.sqrt(np.maximum(np.diag(H), 1e-300))
    A = H * np.outer(scale, scale) + mu * np.eye(len(g))
    return -scale * np.linalg.lstsq(A, scale * g, rcond=1e-12)[0]


def _at(
    sample: _Sample, way: Way, state: State, amounts: Floats | None = None,
    last: Sequence[Look | None] = (),
) -> _Point:  # fmt: skip
    """Return a point at a state with the way's values moved by ``amounts``."""
    amounts = np.zeros(len(way.steps)) if amounts is None else amounts
    given = {name: sample.given[name] for name, _ in way.steps}
    for (name, step), amount in zip(way.steps, amounts, strict=True):
        given[name] = BLOCKS[name].retract(given[name], amount * step)
    values = {name: (value,) * len(state.values[name]) for name, value in given.items()}
    state = replace(state, values={**state.values, **values})
    last = last or [None] * sample.layout.frames
    looks = [look(o, way.law, state, k, last[k]) for k, o in enumerate(sample.observed)]
    return _Point(state, amounts, looks)


def _moved(sample: _Sample, way: Way, now: _Point, step: Floats) -> _Point:
    layout = way.layout or sample.layout
    size = layout.columns
    state = layout.retract(now.state, step[:size])
    return _at(sample, way, state, now.amounts + step[size:], now.looks)


def _jacobian(sample: _Sample, way: Way, at: _Point) -> Floats:
    """Return the derivatives (G + K, N), zero where there is no residual."""
    parts, layout = [], way.layout or sample.layout
    for k, (observed, now) in enumerate(zip(sample.observed, at.looks, strict=True)):
        own = derivatives(observed, way.law, at.state, layout, k, now)
        further = [along(observed, way.law, at.state, k, now, *step) for step in way.steps]
        parts.append(np.concatenate([own, np.reshape(further, (-1, len(now.r)))]))
    return np.nan_to_num(np.concatenate(parts, 1))


def _noise(r: Floats) -> float:
    return max(MAD_TO_STD * float(np.nanmedian(np.abs(r))), 1e-6)


def _cost(r: Floats, sigma: float) -> float:
    """Return the robust cost, noise variances."""
    square = np.where(np.isfinite(r), (r / sigma) ** 2, _FAR**2)
    return float(_CAUCHY**2 / 2 * np.log1p(square / _CAUCHY**2).sum())
