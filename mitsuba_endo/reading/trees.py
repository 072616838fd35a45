"""YAML and JSON: mappings that are neither too deep nor too large, of numbers that are numbers."""

import json
from pathlib import Path
from typing import Any

import yaml

from ..errors import InputError, shown
from .regular import JSON, YAML, read_text

DEEPEST = 40
"""Levels; the files of this package have seven."""
MOST = 1_000_000
"""Values, those behind an alias counted wherever it stands: nine lines of YAML can make 10^9."""
LARGEST = 2.0**128
"""Magnitude of a number; seeds have up to 128 bits."""
_BROKEN = (
    ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError, RecursionError,
)  # fmt: skip
"""What PyYAML raises for dates, tags and numbers that are none, besides its own errors."""


class _RepeatedKey(yaml.YAMLError):
    """A mapping has a key twice: PyYAML would take the last one without a word."""

    def __init__(self, key: str, line: int) -> None:
        self.key, self.line = key, line


class _RepeatedNameError(ValueError):
    """An object of JSON has a name twice: Python would take the last one without a word."""


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the object of a JSON text, in which no name stands twice."""
    data = dict[str, Any]()
    for name, value in pairs:
        if name in data:
            raise _RepeatedNameError(name)
        data[name] = value
    return data


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader, which takes no key twice."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._merged = set[int]()
        """Mappings that hold those of others already, which their own ones override."""

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """Look at a mapping's own keys before those of other mappings are merged into it."""
        own = set[tuple[str, str]]()
        for key, _ in [] if id(node) in self._merged else node.value:
            if isinstance(key, yaml.ScalarNode):
                name = key.tag, key.value
                if name in own:
                    raise _RepeatedKey(key.value, key.start_mark.line + 1)
                own.add(name)
        self._merged.add(id(node))
        super().flatten_mapping(node)


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Read a YAML mapping.

    Raises:
        InputError: missing, too large or too deep, no YAML, a key that stands twice, or no mapping.
    """
    text = read_text(path, YAML)
    try:
        data = yaml.load(text, _Loader)  # a SafeLoader
    except _RepeatedKey as error:
        where = f"{path}: {error.key}"
        raise InputError(f"stands twice, again in line {error.line}", where, "keep one") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f" in line {mark.line + 1}" if mark else ""
        raise InputError(f"is not valid YAML{line}", str(path), "mend its syntax") from None
    except _BROKEN:
        raise InputError(
            "is not valid YAML (a number, date or tag that is none, or too deep)", str(path),
            "mend its syntax",
        ) from None  # fmt: skip
    if not isinstance(data, dict):
        raise InputError("holds no mapping of keys to values", str(path), "see the rig file docs")
    check_tree(data, str(path))
    return data


def read_json(path: str | Path, todo: str = "give a solution or truth file") -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        InputError: missing, too large or too deep, no JSON, a name that stands twice, or no object.
    """
    return parse_json(read_text(path, JSON), str(path), todo)


def parse_json(text: str, source: str, todo: str) -> dict[str, Any]:
    """Read a JSON object from a text; see :func:`read_json`."""
    try:
        data = json.loads(text, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise InputError(
            f"is not valid JSON (line {error.lineno})", source, "mend or remake it"
        ) from None
    except _RepeatedNameError as error:
        raise InputError(f"{shown(str(error))} stands twice", source, "keep one") from None
    except (ValueError, RecursionError):
        raise InputError(
            "is not valid JSON (a number too long, or too deep)", source, "mend or remake it"
        ) from None
    if not isinstance(data, dict):
        raise InputError("holds no JSON object", source, todo)
    check_tree(data, source)
    return data


def any_mapping(text: str, source: str) -> dict[str, Any]:
    """Return the mapping that a text holds as JSON or as its first YAML document, or none at all.

    Raises:
        InputError: it is too deep or too large.
    """
    try:
        if text.lstrip().startswith("{"):
            data = json.loads(text)
        else:  # a printed message ends with the mark of a next document
            data = next(iter(yaml.safe_load_all(text)), None)
    except (yaml.YAMLError, *_BROKEN):
        return {}
    if not isinstance(data, dict):
        return {}
    check_tree(data, source)
    return data


def check_tree(data: Any, source: str) -> None:
    """Refuse what is nested too deeply, has too many values, or values that nothing can take.

    Raises:
        InputError: names the source and the place.
    """
    waiting: list[tuple[Any, tuple[str, ...]]] = [(data, ())]
    count = 0
    while waiting:
        value, at = waiting.pop()
        count += 1
        if len(at) > DEEPEST:
            raise InputError(f"is nested more than {DEEPEST} deep", source, "make it flatter")
        if count > MOST:
            raise InputError(f"holds more than {MOST} values", source, "make it smaller")
        if isinstance(value, dict):
            waiting += [(v, (*at, str(k))) for k, v in value.items()]
            waiting += [(k, at) for k in value if not isinstance(k, dict | list | tuple)]
        elif isinstance(value, list | tuple | set):
            waiting += [(v, (*at, str(i))) for i, v in enumerate(value)]
        else:
            _check_leaf(value, source, at)


def _check_leaf(value: Any, source: str, at: tuple[str, ...]) -> None:
    where = f"{source}: {'.'.join(at)}" if at else source
    if isinstance(value, int | float) and LARGEST < abs(value) < float("inf"):
        raise InputError("is no number of this world", where, "mend the value")
    if isinstance(value, str):
        try:
            value.encode()
        except UnicodeEncodeError:
            raise InputError("holds half a character", where, "mend the text") from None
