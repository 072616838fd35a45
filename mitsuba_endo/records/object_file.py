"""Objects of this program in one npz file: exact to the last bit, and without code to run.

What an object is made of, its dataclass fields or its attributes, stands in a tree of JSON; arrays
stand beside it, each once, and an object that is met twice is one object again. Only classes of
this package are made on reading, without calling them, so that a file of unknown origin can hold
wrong values but nothing that acts.
"""

import json
import zipfile
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from ..files import atomic_path
from ..reading.npz import Arrays, open_npz
from .sealed_arrays import SEAL, check_seal, seal_of

FORMAT = 2
"""Of the file; 1 had no checksum."""
PACKAGE = __name__.partition(".")[0]
LEVEL = 1
"""Of compression: noise hardly shrinks further, and saving holds the work up."""
_PLAIN = (bool, int, float, str, type(None))


def save_objects(path: str | Path, roots: Mapping[str, object]) -> None:
    """Write objects by their names.

    Args:
        path: an npz file.
        roots: numbers, texts, arrays, containers of these, and objects of this package.

    Raises:
        InputError: the file cannot be written.
        TypeError: an object of another kind.
    """
    writer = _Writer()
    tree = json.dumps({"format": FORMAT, "roots": writer.node(dict(roots))}).encode()
    arrays = {"tree": np.frombuffer(tree, np.uint8)}
    arrays |= {f"array_{k}": array for k, array in enumerate(writer.arrays)}
    arrays[SEAL] = seal_of(arrays.items())
    with (
        atomic_path(path) as aside,
        zipfile.ZipFile(aside, "w", zipfile.ZIP_DEFLATED, compresslevel=LEVEL) as file,
    ):
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def load_objects(path: str | Path, what: str, todo: str) -> dict[str, Any]:
    """Read what :func:`save_objects` wrote.

    Args:
        path: the file.
        what: how it is called where it is damaged, or of another version of this program.
        todo: what to do then.

    Raises:
        InputError: missing, damaged, changed since it was written, or of another version.
    """
    with open_npz(path, what, todo) as data:
        tree = json.loads(bytes(data.get("tree", (None,), "u")))
        if tree["format"] != FORMAT:
            raise ValueError
        check_seal(data, todo)
        objects = _Reader(data).value(tree["roots"])
        if not isinstance(objects, dict):
            raise ValueError
        return objects


class _Writer:
    """Turns values into nodes of the tree: plain values, lists, or {kind: content}."""

    def __init__(self) -> None:
        self.arrays: list[NDArray[Any]] = []
        self._numbers: dict[int, int] = {}
        """Of arrays and of objects, by identity; each counted on their own."""
        self._objects: list[object] = []
        """Kept, so that no identity is used twice."""

    def node(self, value: object) -> Any:
        if type(value) in _PLAIN:
            return value
        if type(value) is list:
            return [self.node(item) for item in value]
        for kind, (of, write, _) in _KINDS.items():
            if isinstance(value, of):
                return {kind: write(self, value)}
        if type(value).__module__.partition(".")[0] != PACKAGE or isinstance(value, type):
            raise TypeError(f"{type(value)} cannot be saved")
        return self._object(value)

    def array(self, value: NDArray[Any]) -> int:
        if id(value) not in self._numbers:
            self._numbers[id(value)] = len(self.arrays)
            self.arrays.append(value)
        return self._numbers[id(value)]

    def _object(self, value: object) -> Any:
        if id(value) in self._numbers:
            return {"same": self._numbers[id(value)]}
        self._numbers[id(value)] = number = len(self._objects)
        self._objects.append(value)
        content = {name: self.node(item) for name, item in _content(value).items()}
        return {"object": [number, _name(type(value)), content]}


class _Reader:
    """Turns nodes back into values."""

    def __init__(self, data: Arrays) -> None:
        self._data = data
        self._objects: dict[int, object] = {}
        self._arrays: dict[int, NDArray[Any]] = {}

    def value(self, node: Any) -> Any:
        if isinstance(node, list):
            return [self.value(item) for item in node]
        if not isinstance(node, dict):
            return node
        ((kind, content),) = node.items()
        if kind == "same":
            return self._objects[content]
        if kind == "object":
            return self._object(*content)
        return _KINDS[kind][2](self, content)

    def array(self, number: int) -> NDArray[Any]:
        if number not in self._arrays:
            self._arrays[number] = self._data.get(f"array_{number}", kinds="fiubU")
        return self._arrays[number]

    def _object(self, number: int, name: str, content: dict[str, Any]) -> object:
        cls = _class(name)
        if not isinstance(content, dict):
            raise TypeError
        made = self._objects[number] = object.__new__(cls)
        values = {key: self.value(node) for key, node in content.items()}
        if is_dataclass(cls) and values.keys() != {field.name for field in fields(cls)}:
            raise ValueError  # of another version
        made.__dict__.update(values)
        return made


def _content(value: object) -> dict[str, Any]:
    """Return what an object is made of; what it has computed and kept besides is left out."""
    if is_dataclass(value):
        return {field.name: getattr(value, field.name) for field in fields(value)}
    return vars(value)


def _name(cls: type) -> str:
    return f"{cls.__module__}:{cls.__qualname__}"


def _class(name: object) -> type:
    """Return a class of this package.

    Raises:
        TypeError: the name is no text.
        ValueError: there is none of this name.
    """
    if not isinstance(name, str):
        raise TypeError
    module, _, own = name.partition(":")
    if module.partition(".")[0] != PACKAGE or module.endswith("__main__"):
        raise ValueError
    try:
        cls = getattr(import_module(module), own)
    except (ImportError, AttributeError):
        raise ValueError from None
    if not (isinstance(cls, type) and cls.__module__ == module):
        raise ValueError
    return cls


def _generator(_reader: _Reader, content: Any) -> np.random.Generator:
    made = np.random.default_rng()
    made.bit_generator.state = content
    return made


def _model(_reader: _Reader, content: Any) -> BaseModel:
    cls = _class(content[0])
    if not issubclass(cls, BaseModel):
        raise TypeError
    return cls.model_validate(content[1])


_Kind = tuple[type, Callable[[_Writer, Any], Any], Callable[[_Reader, Any], Any]]
_KINDS: dict[str, _Kind] = {
    "array": (np.ndarray, _Writer.array, _Reader.array),
    "number": (
        np.generic,
        lambda w, x: w.array(np.asarray(x)),
        lambda r, k: r.array(k)[()],
    ),
    "tuple": (
        tuple,
        lambda w, x: [w.node(item) for item in x],
        lambda r, c: tuple(r.value(item) for item in c),
    ),
    "dict": (
        dict,
        lambda w, x: [[w.node(k), w.node(v)] for k, v in x.items()],
        lambda r, c: {r.value(k): r.value(v) for k, v in c},
    ),
    "set": (
        set,
        lambda w, x: [w.node(item) for item in sorted(x)],
        lambda r, c: {r.value(item) for item in c},
    ),
    "deque": (
        deque,
        lambda w, x: [x.maxlen, [w.node(item) for item in x]],
        lambda r, c: deque((r.value(item) for item in c[1]), c[0]),
    ),
    "generator": (np.random.Generator, lambda _w, x: x.bit_generator.state, _generator),
    "model": (
        BaseModel,
        lambda _w, x: [_name(type(x)), x.model_dump(mode="json", by_alias=True)],
        _model,
    ),
}
"""What is neither plain nor a list nor an object of this package: type, how it is written, read."""
