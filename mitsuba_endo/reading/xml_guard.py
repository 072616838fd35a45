"""XML whose depth is bounded before a library descends into it."""

import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

from ..errors import InputError
from .regular import SCENE, read_bytes

DEEPEST = 64
"""Levels of elements; Mitsuba's scenes have ten."""
MOST = 200_000
"""Elements."""


def read_xml(path: str | Path, missing: str = "no such file") -> ET.Element:
    """Read an XML file and return its root.

    Raises:
        InputError: missing, too large or too deep, with declarations of entities, or no XML.
    """
    data = read_bytes(path, SCENE, missing)
    try:
        _check(data)
        return ET.fromstring(data)
    except (ET.ParseError, expat.ExpatError, ValueError, LookupError, UnicodeError) as error:
        raise InputError(f"is not valid XML ({error})", str(path), "correct it") from None


def _check(data: bytes) -> None:
    depth = count = 0

    def begin(name: str, attributes: object) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > DEEPEST:
            raise ValueError(f"more than {DEEPEST} elements in each other")
        if count > MOST:
            raise ValueError(f"more than {MOST} elements")

    def end(name: str) -> None:
        nonlocal depth
        depth -= 1

    def declare(*arguments: object) -> None:
        raise ValueError("it declares entities")

    parser = expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.EntityDeclHandler = declare
    parser.Parse(data, True)
