"""Rigs of which something is said that is not so, or all that is said is right.

Sheets in closed form seen by NumPy ray casting (:mod:`tests.rigs`), small so that hundreds of draws
take minutes. Units mm, radians, pattern pixels.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform

sys.path.insert(0, str(Path(__file__).parents[2]))
from tests import rigs

SIZE = (512, 400)
"""Of the pattern."""
CAMERA = (128, 96)
OUTLIERS = 0.1
LEAST_SEEN = 0.4
"""Share of the image that the pattern must cover in every frame."""

Given = dict[str, Any]
"""A rig file."""


@dataclass(frozen=True)
class Setting:
    """What is drawn with a seed."""

    law: str = "direction_cosine"
    frames: int = 1
    """Each of its own surface; the projector is clamped."""
    noise: float = 0.2
    moves: float = 0.0
    """Standard deviation, degrees, by which the projector turns between frames; in mm a tenth."""


@dataclass(frozen=True)
class Kind:
    """One thing that is said wrongly."""

    change: Callable[[Given], None]
    names: tuple[str, ...]
    """Beginnings of the keys of candidates that it is rightly called."""
    whole: str = ""
    """Key of the block of which several values are off, if so."""
    setting: Setting = field(default_factory=Setting)


def right_setting(seed: int) -> Setting:
    """Return a setting of a right model: both laws, one and four frames, noise 0.05 to 1 px."""
    noise = float(np.exp(np.random.default_rng((seed, 7)).uniform(np.log(0.05), 0.0)))
    law = ("direction_cosine", "pinhole")[seed % 2]
    return Setting(law, 4 if seed % 8 < 2 else 1, noise)


def draw(seed: int, setting: Setting) -> list[rigs.Rig]:
    """Return the frames of a rig."""
    rng = np.random.default_rng(seed)
    while True:
        focal = SIZE[0] * rng.uniform(0.6, 1.4)
        x, y = (np.array(SIZE) - 1) * rng.uniform(0.45, 0.55, 2)
        model = projector_model(setting.law, focal, (x, y))
        pose = _pose(rng)
        found = [_frame(rng, model, pose if k == 0 else _moved(rng, pose, setting.moves))
                 for k in range(setting.frames)]  # fmt: skip
        if min(np.isfinite(f.q[..., 0]).mean() for f in found) > LEAST_SEEN:
            return [_noisy(f, setting.noise, 10 * seed + k) for k, f in enumerate(found)]


def given(frames: Sequence[rigs.Rig], law: str) -> Given:
    """Return the rig file that is right."""
    camera, projector = frames[0].camera, frames[0].projector
    out: Given = {
        "camera": {
            "model": "opencv", "width": camera.width, "height": camera.height,
            "K": np.array(camera.K).tolist(), "distortion": list(camera.distortion),
        },
        "projector": {
            "law": law, "width": SIZE[0], "height": SIZE[1],
            "centre": [float(x) for x in projector.centre],
        },
        "scale": {"baseline": frames[0].baseline},
    }  # fmt: skip
    if len(frames) > 1:
        out["share"] = {"surface": "per_frame", "projector_pose": "shared"}
    return out


def _pose(rng: np.random.Generator) -> RigidTransform:
    angle, out = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(-25, 25))
    t = [np.cos(out) * np.cos(angle), np.cos(out) * np.sin(angle), np.sin(out)]
    axis = rng.normal(size=3)
    turn = axis / np.linalg.norm(axis) * np.radians(rng.uniform(0, 20))
    return RigidTransform.of(turn, rng.uniform(5, 10) * np.array(t))


def _moved(rng: np.random.Generator, pose: RigidTransform, degrees: float) -> RigidTransform:
    turn = RigidTransform.of(rng.normal(0, np.radians(degrees), 3), np.zeros(3))
    return RigidTransform(turn.R @ pose.R, pose.t + rng.normal(0, degrees / 10, 3))


def _frame(rng: np.random.Generator, model: Any, pose: RigidTransform) -> rigs.Rig:
    tilt = rng.uniform(-0.4, 0.4, 2)
    sheet = rigs.bumpy_sheet(70, (tilt[0], tilt[1]), 6, int(rng.integers(1 << 30)))
    return rigs.cast(rigs.lopsided_camera(*CAMERA), model, SIZE, pose, sheet)


def _noisy(frame: rigs.Rig, noise: float, seed: int) -> rigs.Rig:
    return rigs.with_outliers(rigs.with_noise(frame, noise, seed), OUTLIERS, seed)


def _matrix(given: Given, change: Callable[[np.ndarray], np.ndarray]) -> None:
    given["camera"]["K"] = change(np.array(given["camera"]["K"])).tolist()


def _scaled(fx: float, fy: float) -> Callable[[Given], None]:
    return lambda g: _matrix(g, lambda K: K * [[fx, 1, 1], [1, fy, 1], [1, 1, 1]])


def _shifted(x: float, y: float) -> Callable[[Given], None]:
    return lambda g: _matrix(g, lambda K: K + np.array([[0, 0, x], [0, 0, y], [0, 0, 0]]))


def _resized(factor: float) -> Callable[[Given], None]:
    return lambda g: _matrix(g, lambda K: K * [[factor], [factor], [1]])


def _coefficient(index: int, change: float) -> Callable[[Given], None]:
    def apply(given: Given) -> None:
        given["camera"]["distortion"][index] += change

    return apply


def _projector(**fields: Any) -> Callable[[Given], None]:
    return lambda g: g["projector"].update(fields)


def _centre(given: Given) -> None:
    x, y = given["projector"]["centre"]
    given["projector"]["centre"] = [x + 20, y - 10]


def _unlensed(given: Given) -> None:
    given["camera"]["distortion"] = []


_K = ("camera_focal", "camera_centre", "camera_matrix")
KINDS: dict[str, Kind] = {
    "no distortion": Kind(_unlensed, ("camera_distortion",)),
    "camera k1 + 0.01": Kind(_coefficient(0, 0.01), ("camera_distortion",)),
    "camera k2 + 0.05": Kind(_coefficient(1, 0.05), ("camera_distortion",)),
    "camera focal 3 %": Kind(_scaled(1.03, 1.03), ("camera_focal", "camera_matrix")),
    "camera focal 20 %": Kind(_scaled(1.2, 1.2), ("camera_focal", "camera_matrix")),
    "camera aspect 2 %": Kind(_scaled(1, 1.02), ("camera_focal.aspect",), "camera_focal"),
    "camera cx + 4 px": Kind(_shifted(4, 0), ("camera_centre", "camera_matrix")),
    "camera cy + 4 px": Kind(_shifted(0, 4), ("camera_centre", "camera_matrix")),
    "double resolution": Kind(_resized(2), _K),
    "half resolution": Kind(_resized(0.5), _K),
    "crop": Kind(_shifted(-20, -12), ("camera_centre", "camera_matrix")),
    "other law": Kind(_projector(law="pinhole"), ("law",)),
    "projector centre": Kind(_centre, ("centre",)),
    "projector k1": Kind(_projector(distortion=[0.03]), ("distortion",)),
    "projector aspect": Kind(_projector(aspect=1.02), ("aspect",)),
    "clamped, but moves": Kind(
        lambda _: None, ("plan.projector_pose",), setting=Setting(frames=4, moves=1)
    ),
}


def with_law(kind: Kind, law: str) -> Kind:
    """Return a kind of which the truth has another projection model."""
    return replace(kind, setting=replace(kind.setting, law=law))
