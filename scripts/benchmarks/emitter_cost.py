"""The emitter doe_projector against Mitsuba's own projector: cost and agreement of a rendering."""

from functools import partial
from typing import Any

import numpy as np

from mitsuba_endo.rendering import keys
from mitsuba_endo.rendering.axes import to_world_from_pose
from mitsuba_endo.rendering.mitsuba_modules import dr, mi
from mitsuba_endo.shapes.bumpy_sheet import BumpySheet

from .report import Figure, alternating
from .scene import make_scene

NAME = "emitter"
_figure = partial(Figure, NAME)
_SIZE = 512
"""Pattern pixels on each side; square, since Mitsuba's projector scales both axes alike."""
_FOCAL = 300.0


def run(quick: bool) -> list[Figure]:
    """Render the sheet under both in turn."""
    ours, theirs = _scene(_doe_projector()), _scene(_mitsuba_projector())
    samples = 4 if quick else 32

    def render(scene: Any) -> None:
        dr.eval(mi.render(scene, spp=samples, seed=0))
        dr.sync_thread()

    render(ours)  # compiles
    render(theirs)
    ratio = alternating(lambda: render(ours), lambda: render(theirs), 4 if quick else 20)
    a, b = (np.asarray(mi.render(s, spp=samples, seed=0)) for s in (ours, theirs))
    return [
        _figure("render time / Mitsuba's projector", ratio, "ratio", "lower", 1.1),
        _figure("largest difference of the images", float(np.abs(a - b).max() / b.max()),
                "of the maximum", "lower"),
    ]  # fmt: skip


def _pattern() -> Any:
    values = np.random.default_rng(1).uniform(0.1, 1, (_SIZE, _SIZE, 1)).astype(np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(values), "raw": True, "wrap_mode": "clamp"}


def _to_world() -> Any:
    return mi.ScalarTransform4f(to_world_from_pose(make_scene(8, 8).true_pose.inverse()).tolist())


def _doe_projector() -> dict[str, Any]:
    return {
        "type": "doe_projector", "pattern": _pattern(), "focal": _FOCAL, "power": 1000.0,
        "to_world": _to_world(),
    }  # fmt: skip


def _mitsuba_projector() -> dict[str, Any]:
    pattern = _pattern()
    total = float(np.array(pattern["bitmap"]).sum())
    return {
        "type": "projector", "irradiance": pattern, "to_world": _to_world(),
        "fov": float(np.degrees(2 * np.arctan(_SIZE / (2 * _FOCAL)))),
        "scale": 1000.0 * _FOCAL**2 / (np.pi * total),
    }  # fmt: skip


def _scene(emitter: dict[str, Any]) -> Any:
    mesh = BumpySheet().mesh()
    surface = mi.Mesh("surface", len(mesh.vertices), len(mesh.faces))
    parameters = mi.traverse(surface)
    parameters[keys.VERTEX_POSITIONS] = mesh.vertices.astype(np.float32).ravel()
    parameters[keys.FACES] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    camera = {
        "type": "endoscope", "fx": 400.0, "fy": 400.0, "cx": 239.5, "cy": 179.5,
        "film": {"type": "hdrfilm", "width": 480, "height": 360, "rfilter": {"type": "box"}},
    }  # fmt: skip
    return mi.load_dict(
        {"type": "scene", "integrator": {"type": "path", "max_depth": 3}, "camera": camera,
         "projector": emitter, "surface": surface}
    )  # fmt: skip
