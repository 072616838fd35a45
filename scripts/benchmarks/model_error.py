"""Wrong models: whether a calibration notices, names the cause and widens its intervals.

Small NumPy scenes, each draw with its own rig, surface, noise and outliers. Seeds from 5000 on
judge; others were used while thresholds were chosen.
"""

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.laws import projector_model
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.records.solution import INTERVAL, Solution
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

from .report import Figure

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests import rigs

NAME = "model_error"
_figure = partial(Figure, NAME)
_SEED, _NOISE, _OUTLIERS, _SIZE = 5000, 0.2, 0.1, (512, 400)
_RIGHT, _WRONG = 40, 5
"""Draws of the right model, and of each wrong one."""

Given = dict[str, Any]


def _matrix(given: Given, change: Callable[[np.ndarray], np.ndarray]) -> None:
    given["camera"]["K"] = change(np.array(given["camera"]["K"])).tolist()


def _scaled(fx: float, fy: float) -> Callable[[Given], None]:
    return lambda g: _matrix(g, lambda K: K * [[fx, 1, 1], [1, fy, 1], [1, 1, 1]])


def _moved(x: float, y: float) -> Callable[[Given], None]:
    return lambda g: _matrix(g, lambda K: K + np.array([[0, 0, x], [0, 0, y], [0, 0, 0]]))


def _resized(factor: float) -> Callable[[Given], None]:
    return lambda g: _matrix(g, lambda K: K * [[factor], [factor], [1]])


def _camera_term(index: int, change: float) -> Callable[[Given], None]:
    def apply(given: Given) -> None:
        given["camera"]["distortion"][index] += change

    return apply


def _projector(**fields: Any) -> Callable[[Given], None]:
    return lambda g: g["projector"].update(fields)


def _centre(given: Given) -> None:
    x, y = given["projector"]["centre"]
    given["projector"]["centre"] = [x + 20, y - 10]


KINDS: dict[str, tuple[Callable[[Given], None], tuple[str, ...]]] = {
    "no distortion": (lambda g: g["camera"].update(distortion=[]), ("camera_distortion",)),
    "camera k1": (_camera_term(0, 0.01), ("camera_distortion.k1",)),
    "camera k2": (_camera_term(1, 0.05), ("camera_distortion.k2",)),
    "camera focal 3 %": (_scaled(1.03, 1.03), ("camera_focal.focal",)),
    "camera focal 20 %": (_scaled(1.2, 1.2), ("camera_focal.focal",)),
    "camera aspect 2 %": (_scaled(1, 1.02), ("camera_focal.aspect",)),
    "camera cx": (_moved(4, 0), ("camera_centre.x",)),
    "camera cy": (_moved(0, 4), ("camera_centre.y",)),
    "double resolution": (_resized(2), ("camera_focal", "camera_centre")),
    "half resolution": (_resized(0.5), ("camera_focal", "camera_centre")),
    "crop": (_moved(-20, -12), ("camera_centre",)),
    "other law": (_projector(law="pinhole"), ("law",)),
    "projector centre": (_centre, ("centre",)),
    "projector k1": (_projector(distortion=[0.03]), ("distortion.k1",)),
    "projector aspect": (_projector(aspect=1.02), ("aspect",)),
}
"""What is changed, and the keys of the candidates that it is rightly called."""


def run(quick: bool) -> list[Figure]:
    """Calibrate right and wrong models."""
    right = [_solve(_SEED + k, None) for k in range(2 if quick else _RIGHT)]
    out = _right_figures([r for r in right if r[0] is not None])
    for kind in list(KINDS)[:2] if quick else KINDS:
        solved = [_solve(_SEED + 100 + k, kind) for k in range(1 if quick else _WRONG)]
        out += _wrong_figures(kind, solved)
    return out


def _solve(seed: int, kind: str | None) -> tuple[Solution | None, rigs.Rig]:
    """Return the solution, None where the input was refused, and the truth."""
    rig = _scene(seed)
    given = _given(rig)
    if kind is not None:
        KINDS[kind][0](given)
    try:
        map_ = CorrespondenceMap(q=rig.q.astype(np.float32), name="a")
        return calibrate([map_], Rig.model_validate(given), Options(check_model=True)).solution, rig
    except InputError:
        return None, rig


def _scene(seed: int) -> rigs.Rig:
    rng = np.random.default_rng(seed)
    while True:
        focal = _SIZE[0] * rng.uniform(0.6, 1.4)
        x, y = (np.array(_SIZE) - 1) * rng.uniform(0.45, 0.55, 2)
        angle, out = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(-25, 25))
        t = [np.cos(out) * np.cos(angle), np.cos(out) * np.sin(angle), np.sin(out)]
        axis = rng.normal(size=3)
        turn = axis / np.linalg.norm(axis) * np.radians(rng.uniform(0, 20))
        pose = rigs.RigidTransform.of(turn, rng.uniform(5, 10) * np.array(t))
        tilt = rng.uniform(-0.4, 0.4, 2)
        sheet = rigs.bumpy_sheet(70, (tilt[0], tilt[1]), 6, int(rng.integers(1 << 30)))
        model = projector_model("direction_cosine", focal, (x, y))
        rig = rigs.cast(rigs.lopsided_camera(128, 96), model, _SIZE, pose, sheet)
        if np.isfinite(rig.q[..., 0]).mean() > 0.4:
            return rigs.with_outliers(rigs.with_noise(rig, _NOISE, seed), _OUTLIERS, seed)


def _given(rig: rigs.Rig) -> Given:
    camera = rig.camera
    return {
        "camera": {
            "model": "opencv", "width": camera.width, "height": camera.height,
            "K": np.array(camera.K).tolist(), "distortion": list(camera.distortion),
        },
        "projector": {
            "law": rig.projector.law, "width": _SIZE[0], "height": _SIZE[1],
            "centre": [float(x) for x in rig.projector.centre],
        },
        "scale": {"baseline": rig.baseline},
    }  # fmt: skip


def _deviations(solution: Solution, rig: rigs.Rig) -> float:
    """Return the focal length's error over its stated deviation."""
    focal = solution.projector.focal
    if not isinstance(focal.value, float) or not isinstance(focal.std, float):
        return 0.0
    return abs(focal.value - float(rig.projector.focal)) / focal.std


def _right_figures(solved: list[tuple[Solution | None, rigs.Rig]]) -> list[Figure]:
    known = [(s, r) for s, r in solved if s is not None]
    alarms = np.mean([s.model["suspected"] for s, _ in known])
    inside = np.mean([_deviations(s, r) < INTERVAL for s, r in known])
    wider = np.mean([s.model["intervals_by"] for s, _ in known])
    return [
        _figure("right: draws", len(known), "", ""),
        _figure("right: false alarms", 100 * float(alarms), "%", "lower", 2),
        _figure("right: truth inside 95 %", 100 * float(inside), "%", "higher", 93),
        _figure("right: width of intervals over noise alone", float(wider), "", "lower", 1.15),
    ]


def _wrong_figures(kind: str, solved: list[tuple[Solution | None, rigs.Rig]]) -> list[Figure]:
    """Return shares of detected and named; a refusal of the input is both."""
    seen = [s is None or s.model["suspected"] for s, _ in solved]
    named = [s is None or _named(s, KINDS[kind][1]) for s, _ in solved]
    unwarned = [
        not is_seen and s is not None and _deviations(s, r) > 3
        for is_seen, (s, r) in zip(seen, solved, strict=True)
    ]
    return [
        _figure(f"{kind}: detected, {len(solved)} draws", 100 * float(np.mean(seen)), "%",
                "higher", 99),
        _figure(f"{kind}: first or second named", 100 * float(np.mean(named)), "%", "higher", 90),
        _figure(f"{kind}: unwarned beyond 3 deviations", float(np.sum(unwarned)), "", "lower", 0),
    ]  # fmt: skip


def _named(solution: Solution, keys: tuple[str, ...]) -> bool:
    """Tell whether the right candidate, or one of whose group it is, is among the first two."""
    candidates = solution.model["candidates"]
    words = {c["words"] for c in candidates if c["key"].startswith(keys)}
    return any(c["key"].startswith(keys) or words & set(c["group"]) for c in candidates[:2])
