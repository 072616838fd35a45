"""Loading scene files and reading camera, projector and surface out of them."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from .. import backend
from ..errors import InputError
from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel, projector_model
from ..geometry.transforms import RigidTransform
from ..interrupts import uninterrupted
from ..litter import scratch_folder
from ..reading.regular import is_file
from ..reading.xml_guard import read_xml
from ..shapes import Mesh
from . import keys
from .axes import pose_from_to_world
from .generated import generate
from .scene_references import check_references

PACKAGED = "mitsuba_endo.scenes"


@dataclass(frozen=True, eq=False)
class LoadedScene:
    """A Mitsuba scene with a camera, a projector and a surface under their usual ids."""

    scene: Any
    """The ``mi.Scene``."""
    source: str
    """File it came from, for messages."""
    parameters: Mapping[str, str]
    """Value of every ``$parameter`` of the file, as given or by default."""

    def sensor(self) -> Any:
        """Return the ``endoscope`` sensor."""
        return self._find(self.scene.sensors(), keys.CAMERA, "endoscope sensor", "fx")

    def emitter(self) -> Any:
        """Return the ``doe_projector`` emitter."""
        return self._find(self.scene.emitters(), keys.PROJECTOR, "doe_projector emitter", "law")

    def camera(self) -> CameraModel:
        """Return the camera's intrinsics."""
        sensor, values = self.sensor(), self._values()
        fx, fy, cx, cy = (_number(values[k]) for k in keys.intrinsics())
        width, height = (int(n) for n in values[keys.film_size()])
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        lens = [_number(values[k]) for k in keys.lens(sensor.model)]
        return CameraModel(sensor.model, width, height, K, _trimmed(lens, sensor.model))

    def world_from_camera(self) -> RigidTransform:
        """Return the camera's pose, OpenCV axes."""
        return _pose(self._values()[keys.to_world(keys.CAMERA)])

    def projector(self) -> ProjectorModel:
        """Return the projector's intrinsics as plain numbers."""
        law, values = self.emitter().law, self._values()
        distortion = [_number(values[k]) for k in keys.distortion()]
        return projector_model(
            law,
            _number(values[keys.focal()]),
            [_number(values[k]) for k in keys.centre()],
            _number(values[keys.aspect()]),
            distortion if any(distortion) else (),
        )

    def pattern_size(self) -> tuple[int, int]:
        """Return width and height of the pattern, pattern pixels."""
        emitter = self.emitter()
        return emitter.width, emitter.height

    def world_from_projector(self) -> RigidTransform:
        """Return the projector's pose, OpenCV axes."""
        return _pose(self._values()[keys.to_world(keys.PROJECTOR)])

    def surface(self) -> Mesh:
        """Return the surface's mesh in the world, mm.

        Raises:
            InputError: the scene has no mesh with the id ``surface``.
        """
        values = self._values()
        if keys.vertex_positions() not in values or keys.faces() not in values:
            raise InputError(
                f"no mesh with the id {keys.SURFACE!r}",
                self.source,
                "give one of its shapes this id",
            )
        vertices = np.array(values[keys.vertex_positions()], np.float64).reshape(-1, 3)
        faces = np.array(values[keys.faces()], np.int64).reshape(-1, 3)
        uv = np.array(values[keys.vertex_texcoords()], np.float64).reshape(-1, 2)
        return Mesh(vertices, faces, uv if len(uv) else None)

    def _values(self) -> Any:
        from .mitsuba_modules import mi

        return mi.traverse(self.scene)

    def _find(self, objects: Any, identifier: str, kind: str, attribute: str) -> Any:
        matches = [o for o in objects if o.id() == identifier and hasattr(o, attribute)]
        if matches:
            return matches[0]
        raise InputError(
            f"no {kind} with the id {identifier!r}", self.source, f'add one with id="{identifier}"'
        )


def load_scene(source: str | Path, **parameters: object) -> LoadedScene:
    """Load a scene file, or a packaged scene by name, with some of its ``$parameters`` set.

    Values such as ``shape:colon?seed=3`` are generated (see :mod:`.generated`). Mitsuba is started
    if no variant is active.

    Args:
        source: path of a scene XML, or one of :func:`packaged_scenes`.
        parameters: values of parameters that the file declares with ``<default>``.

    Raises:
        InputError: no such file or scene, broken XML, a parameter that the scene has not, a
            description or value that Mitsuba refuses, or no camera or projector in the scene.
    """
    scene, values = open_scene(source, **parameters)
    loaded = LoadedScene(scene, str(source), values)
    loaded.sensor()
    loaded.emitter()
    return loaded


def open_scene(source: str | Path, **parameters: object) -> tuple[Any, Mapping[str, str]]:
    """Load a scene whatever is in it; return the ``mi.Scene`` and all its parameters' values.

    Raises:
        InputError: as :func:`load_scene`, which demands a camera and a projector besides.
    """
    backend.ensure()
    from .mitsuba_modules import mi

    path = find_scene(source)
    root = _root(path)
    declared = _declared(root)
    unknown = sorted(set(parameters) - set(declared))
    if unknown:
        raise InputError(
            f"has no parameter {unknown[0]!r}",
            str(source),
            f"it has {', '.join(declared)}" if declared else "it has no parameters at all",
        )
    values = declared | {name: str(value) for name, value in parameters.items()}
    for name, value in values.items():
        if "nan" in re.split(r"[\s,]+", value.strip().lower()):  # would only blacken the image
            raise InputError(f"parameter {name!r} is {value}", str(source), "give it a number")
    with scratch_folder() as folder:
        resolved = {name: generate(name, value, folder) for name, value in values.items()}
        check_references(root, path.parent, resolved)
        try:
            # Mitsuba makes of an interrupt in a plugin of Python's an error of the scene.
            with uninterrupted():
                return mi.load_file(str(path), **resolved), values
        except RuntimeError as error:
            raise InputError(_message(error), str(source), "correct the scene or value") from error


def packaged_scenes() -> list[str]:
    """Return the names of the scenes that come with the package."""
    files = resources.files(PACKAGED).iterdir()
    return sorted(f.name.removesuffix(".xml") for f in files if f.name.endswith(".xml"))


def find_scene(source: str | Path) -> Path:
    """Return the path of a scene file or of the packaged scene of this name.

    Raises:
        InputError: there is neither.
    """
    path = Path(source)
    if is_file(path):
        return path
    name = str(source).removesuffix(".xml")
    if name in packaged_scenes():
        return Path(str(resources.files(PACKAGED) / f"{name}.xml"))
    raise InputError(
        "no such scene file", str(source), f"give a path or one of {', '.join(packaged_scenes())}"
    )


def _root(path: Path) -> ET.Element:
    root = read_xml(path)
    if root.tag != "scene":
        raise InputError(f"starts with <{root.tag}>", str(path), "give a Mitsuba scene file")
    return root


def _declared(root: ET.Element) -> dict[str, str]:
    """Return the parameters that the scene declares, with their defaults."""
    return {d.attrib["name"]: d.attrib["value"] for d in root.iter("default")
            if {"name", "value"} <= d.attrib.keys()}  # fmt: skip


def _message(error: BaseException) -> str:
    """Return Mitsuba's message on one line, without the places in its source code.

    A plugin written in Python brings its whole traceback: of that the plugin's type is kept, and
    what follows the exception's name.
    """
    text = re.sub(r"\[\w+\.(cpp|h):\d+\]\s*", "", str(error))
    before, traceback, raised = text.rpartition("Traceback (most recent call last):\n")
    if traceback:
        plugin = re.findall(r'plugin of type "([^"]+)"', before)
        what = re.sub(r"\A(?:[ \t].*\n)*[\w.]+(?:: |\Z)", "", raised)
        text = f"{plugin[-1]}: {what}" if plugin else what
    return re.sub(r"\s+", " ", text).strip().rstrip(".")


def _number(value: Any) -> float:
    return float(np.array(value).ravel()[0])


def _pose(to_world: Any) -> RigidTransform:
    return pose_from_to_world(np.array(to_world.matrix, np.float64).reshape(4, 4))


def _trimmed(lens: list[float], model: str) -> tuple[float, ...]:
    """Leave out trailing zero coefficients, down to a number that the model accepts."""
    from ..geometry.cameras import CAMERAS

    last = max((i + 1 for i, k in enumerate(lens) if k != 0), default=0)
    count = min(n for n in CAMERAS[model].max_coefficients if n >= last)
    return tuple(lens[:count])
