"""The calibrated scene as Mitsuba XML."""

import math
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from ..files import atomic_path
from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..rendering import keys
from ..rendering.axes import to_world_from_pose

_SQUARES_PX = 16
"""Side of the projected squares, pattern pixels. Chosen for looks."""
_SAMPLES = 16
"""Samples per pixel. Chosen for a quick first picture; whoever renders the file sets more."""


def save_scene(
    path: str | Path,
    camera: CameraModel,
    projector: ProjectorModel,
    size: tuple[int, int],
    projector_from_camera: RigidTransform,
    surface: str,
    distance: float,
) -> None:
    """Write a scene that Mitsuba renders as it is, once the package's plugins are registered.

    World is the camera's frame. The projector throws a chequerboard with squares of 16 pattern
    pixels; what is seen is the calibrated surface under it.

    Args:
        path: the XML file.
        camera: intrinsics.
        projector: intrinsics.
        size: width and height of the pattern, pattern pixels.
        projector_from_camera: pose, the surface's unit.
        surface: file name of the PLY surface, beside ``path``, in the camera's frame.
        distance: from the projector to the surface, roughly; sets its power.

    Raises:
        InputError: the file cannot be written.
    """
    scene = ElementTree.Element("scene", version="3.0.0")
    scene.append(
        ElementTree.Comment(
            " The calibrated scene; world is the first camera's frame. Load the plugins first:"
            " mitsuba_endo.backend.use(), then mitsuba.load_file. "
        )
    )
    _add(_plugin(scene, "integrator", "path", "integrator"), "integer", "max_depth", 3)
    _sensor(scene, camera)
    _projector(scene, projector, size, projector_from_camera.inverse(), distance)
    _surface(scene, surface)
    ElementTree.indent(scene)
    with atomic_path(path) as aside:
        aside.write_text(ElementTree.tostring(scene, encoding="unicode") + "\n", encoding="utf-8")


def _sensor(scene: ElementTree.Element, camera: CameraModel) -> None:
    sensor = _plugin(scene, "sensor", "endoscope", keys.CAMERA)
    _add(sensor, "string", "model", camera.model)
    K = camera.K
    _floats(sensor, keys.intrinsics(), (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    _floats(sensor, keys.lens(camera.model), camera.distortion)
    _pose(sensor, RigidTransform.identity())
    film = _plugin(sensor, "film", "hdrfilm", "film")
    _add(film, "integer", "width", camera.width)
    _add(film, "integer", "height", camera.height)
    _plugin(film, "rfilter", "box", "filter")
    _add(_plugin(sensor, "sampler", "independent", "sampler"), "integer", "sample_count", _SAMPLES)


def _projector(
    scene: ElementTree.Element,
    projector: ProjectorModel,
    size: tuple[int, int],
    world_from_projector: RigidTransform,
    distance: float,
) -> None:
    emitter = _plugin(scene, "emitter", "doe_projector", keys.PROJECTOR)
    _add(emitter, "string", "law", projector.law)
    _add(emitter, "integer", "width", size[0])
    _add(emitter, "integer", "height", size[1])
    _floats(emitter, (keys.focal(), keys.aspect()), (projector.focal, projector.aspect))
    _floats(emitter, keys.centre(), projector.centre)
    _floats(emitter, keys.distortion(), projector.distortion.coefficients)
    # A white wall at that distance has the radiance 1 in the bright half of the squares.
    power = math.pi * distance**2 * size[0] * size[1] / (2 * projector.focal**2)
    _add(emitter, "float", "power", f"{power:.4g}")
    _pose(emitter, world_from_projector)
    pattern = _plugin(emitter, "texture", "checkerboard", "pattern")
    pattern.set("name", "pattern")
    transform = ElementTree.SubElement(pattern, "transform", name="to_uv")
    periods = {axis: repr(n / (2 * _SQUARES_PX)) for axis, n in zip("xy", size, strict=True)}
    ElementTree.SubElement(transform, "scale", periods)


def _surface(scene: ElementTree.Element, file_name: str) -> None:
    shape = _plugin(scene, "shape", "ply", keys.SURFACE)
    _add(shape, "string", "filename", file_name)
    material = _plugin(shape, "bsdf", "twosided", "material")
    diffuse = _plugin(material, "bsdf", "diffuse", "tissue")
    ElementTree.SubElement(diffuse, "rgb", name="reflectance", value="0.8, 0.6, 0.55")


def _pose(parent: ElementTree.Element, world_from_object: RigidTransform) -> None:
    transform = ElementTree.SubElement(parent, "transform", name="to_world")
    matrix = to_world_from_pose(world_from_object)
    ElementTree.SubElement(transform, "matrix", value=" ".join(repr(float(v)) for v in matrix.flat))


def _plugin(
    parent: ElementTree.Element, tag: str, kind: str, identifier: str
) -> ElementTree.Element:
    return ElementTree.SubElement(parent, tag, type=kind, id=identifier)


def _floats(
    parent: ElementTree.Element, parameters: Sequence[str], values: Sequence[float]
) -> None:
    """Add parameters named by their keys; values may be fewer, the others keep their defaults."""
    for key, value in zip(parameters, values, strict=False):
        _add(parent, "float", key.partition(".")[2], repr(float(value)))


def _add(parent: ElementTree.Element, tag: str, name: str, value: object) -> None:
    ElementTree.SubElement(parent, tag, name=name, value=str(value))
