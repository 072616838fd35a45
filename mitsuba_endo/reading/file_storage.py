"""OpenCV's FileStorage files, read without OpenCV, whose own reader dies of nesting.

Format: https://docs.opencv.org/4.x/da/d56/classcv_1_1FileStorage.html. A matrix is a mapping of
``rows``, ``cols``, ``dt`` and ``data``.
"""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from ..errors import InputError
from .regular import YAML, read_text
from .trees import check_tree, parse_json
from .xml_guard import read_xml

_HEAD = re.compile(r"\A%YAML[: ]1\.[0-2]\s*?\n")
_LARGEST = 100_000
"""Numbers of a matrix; a camera's have nine, those of points of a target thousands."""


class _Loader(yaml.SafeLoader):
    """YAML with OpenCV's tags for its own structures, which are plain mappings."""


def _mapping(loader: yaml.SafeLoader, suffix: str, node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return loader.construct_mapping(node, deep=True)
    if isinstance(node, yaml.SequenceNode):
        return loader.construct_sequence(node, deep=True)
    return loader.construct_scalar(node)  # type: ignore[arg-type]


_Loader.add_multi_constructor("tag:yaml.org,2002:opencv-", _mapping)


def read_file_storage(path: str | Path) -> dict[str, Any]:
    """Return the top-level nodes of a FileStorage file in YAML, XML or JSON.

    Raises:
        InputError: missing, too large or too deep, or no FileStorage.
    """
    start = read_text(path, YAML)[:200].lstrip("\ufeff \t\r\n")
    if start.startswith("<"):
        return _of_xml(read_xml(path), str(path))
    if start.startswith("{"):
        return parse_json(read_text(path, YAML), str(path), "check the file")
    try:
        data = yaml.load(_HEAD.sub("", read_text(path, YAML)), _Loader)
    except (yaml.YAMLError, ValueError, KeyError, IndexError, TypeError, AttributeError,
            OverflowError, RecursionError):  # fmt: skip
        data = None
    if not isinstance(data, dict):
        raise InputError("is not an OpenCV FileStorage", str(path), "check the file")
    check_tree(data, str(path))
    return data


def number(node: Any) -> float | None:
    """Return a node as a finite number, or None."""
    try:
        value = float(node)
    except (TypeError, ValueError, OverflowError):
        return None
    return value if np.isfinite(value) else None


def matrix(node: Any, source: str) -> NDArray[np.float64]:
    """Return a node that is a matrix.

    Raises:
        InputError: it is none.
    """
    wrong = InputError("holds a matrix that is none", source, "export it with OpenCV")
    if isinstance(node, list):
        node = {"rows": 1, "cols": len(node), "data": node}
    if not isinstance(node, dict):
        raise wrong
    rows, columns = number(node.get("rows")), number(node.get("cols"))
    data = node.get("data")
    values = [number(v) for v in (data if isinstance(data, list) else str(data).split())]
    if rows is None or columns is None or None in values or len(values) > _LARGEST:
        raise wrong
    if rows * columns != len(values) or rows < 0 or rows % 1:
        raise wrong
    return np.array(values, np.float64).reshape(int(rows), -1)


def _of_xml(root: ET.Element, source: str) -> dict[str, Any]:
    if root.tag != "opencv_storage":
        raise InputError("is not an OpenCV FileStorage", source, "check the file")
    return {child.tag: _of_element(child) for child in root}


def _of_element(element: ET.Element) -> Any:
    if not len(element):
        text = (element.text or "").strip()
        return text.strip('"')
    if all(child.tag == "_" for child in element):
        return [_of_element(child) for child in element]
    return {child.tag: _of_element(child) for child in element}
