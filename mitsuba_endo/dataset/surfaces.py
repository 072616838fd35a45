"""Drawing the surface of a sample."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..shapes import Mesh, Polyp, make_shape, parameter_names, parse_shape
from ..shapes.colon import Colon
from .asset_cache import FIGURE, AssetCache
from .ranges import draw_all
from .scene_ranges import FILE, LUMEN, Polyps, Scene
from .view_sampler import LumenViews, MeshViews, SheetViews, ViewSampler

LARGEST_POLYP = 0.6
"""Largest diameter of a polyp, as a share of the tube's radius: larger ones are drawn smaller."""
POLYP_TRIES = 20
"""Places drawn for a polyp before it is left out."""
FEET_APART = 1.5
"""Least distance of two polyps over the sum of their diameters: each flattens the wall."""


@dataclass(frozen=True, eq=False)
class DrawnSurface:
    """A surface and what is known about it."""

    kind: str
    mesh: Mesh
    """In the world, mm; faces counter-clockwise seen from the side the camera is on."""
    parameters: dict[str, Any]
    """With which it can be made again."""
    polyps: list[dict[str, Any]]
    """Truth of each polyp, world frame, mm."""
    views: ViewSampler
    """From where it can be looked at."""


def draw_surface(
    scenes: list[Scene], rng: np.random.Generator, assets: AssetCache
) -> tuple[DrawnSurface, Scene]:
    """Return a surface and the kind of scene it was drawn from.

    Raises:
        InputError: the drawn parameters do not suit each other.
    """
    weights = np.array([scene.weight for scene in scenes])
    number = int(rng.choice(len(scenes), p=weights / weights.sum()))
    scene = scenes[number]
    if scene.kind == FILE:
        mesh = assets.user_mesh(number)
        made = {"file": scene.file, "unit": scene.unit, "side": scene.side}
        return DrawnSurface(FILE, mesh, made, [], MeshViews(mesh, scene.side)), scene
    parameters = draw_all(scene.parameters, rng)
    if "seed" in parameter_names(scene.kind):
        parameters.setdefault("seed", int(rng.integers(2**31)))
    if scene.kind == LUMEN:
        return _colon(parameters, scene, rng), scene
    mesh = _rabbit(parameters, assets) if scene.kind == FIGURE else None
    mesh = mesh or make_shape(scene.kind, **parameters)
    shape: Any = parse_shape(scene.kind, **parameters)
    return DrawnSurface(scene.kind, mesh, parameters, [], SheetViews(shape.distance)), scene


def _rabbit(parameters: dict[str, Any], assets: AssetCache) -> Mesh | None:
    """Turn and scale the ready-made figure, whose making takes seconds; None for another edge."""
    if "edge" in parameters:
        return None
    shape: Any = parse_shape(FIGURE, **parameters)
    figure = assets.figure()
    turned = Rotation.from_euler("y", -shape.yaw).apply(figure.vertices)
    return Mesh(turned * shape.height + [0.0, 0.0, shape.distance], figure.faces)


def _colon(parameters: dict[str, Any], scene: Scene, rng: np.random.Generator) -> DrawnSurface:
    bare: Any = parse_shape(LUMEN, **parameters)
    at = float(scene.view.along.draw(rng)) * bare.length
    if scene.polyps is not None:
        parameters["polyps"] = _polyps(scene.polyps, bare, at, rng)
    colon: Any = parse_shape(LUMEN, **parameters)
    truth = [
        {
            "diameter": p.diameter, "height": p.height, "sphere_radius": p.sphere_radius,
            "centre": p.centre.tolist(), "base": p.base.tolist(), "normal": p.normal.tolist(),
        }
        for p in colon.polyp_truth()
    ]  # fmt: skip
    noted = {**parameters, "polyps": [asdict(p) for p in colon.polyps]}
    return DrawnSurface(LUMEN, colon.mesh(), noted, truth, LumenViews(colon, at))


def _polyps(ranges: Polyps, colon: Colon, at: float, rng: np.random.Generator) -> tuple[Polyp, ...]:
    """Place polyps ahead of the camera; one that finds no free place is left out."""
    poses: list[Polyp] = []
    for _ in range(ranges.count.draw(rng)):
        for _ in range(POLYP_TRIES):
            diameter = min(ranges.diameter.draw(rng), LARGEST_POLYP * colon.radius)
            flatness = float(np.clip(ranges.flatness.draw(rng), 0.1, 0.5))
            new = Polyp(
                along=at + ranges.ahead.draw(rng),
                angle=float(rng.uniform(-np.pi, np.pi)),
                diameter=diameter,
                height=flatness * diameter,
            )
            if new.along < colon.length and all(_apart(new, old, colon.radius) for old in poses):
                poses.append(new)
                break
    return tuple(poses)


def _apart(a: Polyp, b: Polyp, radius: float) -> bool:
    """Tell whether two polyps leave room for the flattened wall around their feet."""
    around = radius * abs(np.angle(np.exp(1j * (a.angle - b.angle))))
    return bool(np.hypot(a.along - b.along, around) > FEET_APART * (a.diameter + b.diameter))
