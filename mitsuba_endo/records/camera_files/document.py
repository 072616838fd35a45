"""A camera file as keys and values, whatever syntax it is written in."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...reading.file_storage import matrix, number, read_file_storage
from ...reading.regular import YAML, read_text
from ...reading.trees import any_mapping


@dataclass(frozen=True)
class Document:
    """The content of one file."""

    path: Path
    text: str
    data: dict[str, Any]
    """Keys and values: matrices of OpenCV as lists of rows; empty if it holds no mapping."""
    part: str = ""
    """Name of the camera that is asked for, where a file holds several."""

    @property
    def where(self) -> str:
        return str(self.path)


def read_document(path: Path, part: str = "") -> Document:
    """Read an OpenCV FileStorage (YAML, XML, JSON), plain YAML or JSON, or text.

    Raises:
        InputError: there is no such file, it is too large or too deep, no text, or its syntax is
            broken.
    """
    text = read_text(path, YAML, "check `camera` in the rig file")
    return Document(path, text, _parse(path, text), part)


def _parse(path: Path, text: str) -> dict[str, Any]:
    if text.startswith("%YAML:1.0") or "<opencv_storage>" in text or "opencv-matrix" in text:
        nodes = read_file_storage(path)
        return {name: _value(node, str(path)) for name, node in nodes.items()}
    return any_mapping(text, str(path))


def _value(node: Any, source: str) -> Any:
    """Return matrices as lists of rows, and numbers that XML has as text as numbers."""
    if isinstance(node, list):
        return [_value(item, source) for item in node]
    if isinstance(node, dict):
        if {"rows", "cols", "dt"} <= node.keys():
            return matrix(node, source).tolist()
        return {name: _value(item, source) for name, item in node.items()}
    value = number(node)
    if value is None or isinstance(node, bool):
        return node
    return int(value) if value.is_integer() and "." not in str(node) else value
