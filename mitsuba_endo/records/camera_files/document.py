"""A camera file as keys and values, whatever syntax it is written in."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import yaml

from ...errors import InputError
from ..validation import read_text


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
        InputError: there is no such file, it is no text, or its syntax is broken.
    """
    if not path.is_file():
        raise InputError("no such file", str(path), "check `camera` in the rig file")
    text = read_text(path)
    return Document(path, text, _parse(path, text), part)


def _parse(path: Path, text: str) -> dict[str, Any]:
    if text.startswith("%YAML:1.0") or "<opencv_storage>" in text or "opencv-matrix" in text:
        return _from_storage(path)
    try:
        if text.lstrip().startswith("{"):
            data = json.loads(text)
        else:  # a printed message ends with the mark of a next document
            data = next(iter(yaml.safe_load_all(text)), None)
    except (json.JSONDecodeError, yaml.YAMLError):
        return {}
    return data if isinstance(data, dict) else {}


def _from_storage(path: Path) -> dict[str, Any]:
    try:
        storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        root = storage.root()
        return {name: _value(root.getNode(name)) for name in root.keys()}  # noqa: SIM118
    except (cv2.error, SystemError):
        raise InputError("is not an OpenCV FileStorage", str(path), "check the file") from None


def _value(node: cv2.FileNode) -> Any:
    if node.isInt():
        return int(node.real())
    if node.isReal():
        return float(node.real())
    if node.isString():
        return node.string()
    if node.isSeq():
        return [_value(node.at(i)) for i in range(node.size())]
    if not node.isMap():
        return None
    names = node.keys()
    if {"rows", "cols", "dt"} <= set(names) or {"sizes", "dt"} <= set(names):
        return node.mat().tolist()
    return {name: _value(node.getNode(name)) for name in names}
