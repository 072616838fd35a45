"""The files that a scene names, looked at before Mitsuba opens them.

Mitsuba waits for a pipe, reads a device for ever, and follows a triangle to a vertex that is not
there.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path

from ..errors import InputError
from ..reading.mesh_files import read_mesh
from ..reading.regular import ANY, exists, regular
from ..reading.xml_guard import read_xml

_MESHES = (".ply", ".obj")
_DEEPEST = 8
"""Scenes that include each other."""


def check_references(
    root: ET.Element, folder: Path, values: Mapping[str, str], depth: int = 0
) -> None:
    """Look at every file that is named in a scene.

    Args:
        root: of the scene.
        folder: in which it lies, as names are relative to it.
        values: of its parameters.
        depth: how many scenes include it.

    Raises:
        InputError: a file is no regular one, too large, or a mesh that is damaged.
    """
    for tag, name in _named(root, values):
        path = folder / name
        if not exists(path):
            continue  # Mitsuba also looks elsewhere, and says what it does not find
        if tag == "include":
            if depth == _DEEPEST:
                raise InputError("scenes include each other", str(path), "include fewer")
            check_references(read_xml(path), path.parent, values, depth + 1)
        elif path.suffix.lower() in _MESHES:
            read_mesh(path)
        else:
            regular(path, ANY)


def _named(root: ET.Element, values: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    for element in root.iter():
        name = element.get("filename" if element.tag == "include" else "value")
        if name and (element.tag == "include" or element.get("name") == "filename"):
            yield element.tag, re.sub(r"\$(\w+)", lambda m: values.get(m[1], m[0]), name)
