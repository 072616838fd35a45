"""Ways to spoil a file: of bytes, of numbers in a text, of a tree, of arrays.

Every function takes the contents of a sound file and a generator of random numbers, and returns the
contents of a spoilt one. The same generator gives the same file.
"""

import io
import json
import re
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
import yaml

Mutate = Callable[[bytes, np.random.Generator], bytes]

NUMBERS = (
    "0", "-1", "1", "-0.0", "1e-300", "1e300", "1e308", "-1e308", "1e400", "nan", ".nan", "inf",
    "Infinity", "-Infinity", ".inf", "2147483647", "2147483648", "-2147483649", "4294967296",
    "9223372036854775807", "1" * 400, "1" * 5000, "0x" + "f" * 5000, "1_000", "1e", "0.1.2",
    "2001-99-99", "1:99:99", "12:30:45.", "''", "true", "null", "[]", "{}",
)  # fmt: skip
INTS = (0, 1, -1, 127, 128, 255, 256, 32767, 65535, 65536, 2**31 - 1, -(2**31), 2**32 - 1, 2**40)
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def flip_bits(data: bytes, rng: np.random.Generator) -> bytes:
    spoilt = bytearray(data)
    for _ in range(int(rng.integers(1, 12))):
        spoilt[_place(spoilt, rng)] ^= 1 << int(rng.integers(8))
    return bytes(spoilt)


def flip_in_head(data: bytes, rng: np.random.Generator) -> bytes:
    """Spoil bytes among the first, where headers are."""
    spoilt = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        spoilt[int(rng.integers(min(len(spoilt), 400)))] = int(rng.integers(256))
    return bytes(spoilt)


def put_integer(data: bytes, rng: np.random.Generator) -> bytes:
    """Overwrite bytes by an integer at which sizes overflow."""
    value, size = int(rng.choice(INTS)), int(rng.choice([1, 2, 4, 8]))
    order = "little" if rng.random() < 0.7 else "big"
    packed = (value % (1 << 8 * size)).to_bytes(size, order)  # type: ignore[arg-type]
    limit = len(data) if rng.random() < 0.4 else min(len(data), 600)
    at = int(rng.integers(max(1, limit)))
    return data[:at] + packed + data[at + size :]


def cut(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: int(rng.integers(len(data)))]


def delete(data: bytes, rng: np.random.Generator) -> bytes:
    at, size = _place(data, rng), int(rng.integers(1, 64))
    return data[:at] + data[at + size :]


def repeat(data: bytes, rng: np.random.Generator) -> bytes:
    at, size = _place(data, rng), int(rng.integers(1, 200))
    return data[:at] + data[at : at + size] * int(rng.integers(2, 30)) + data[at + size :]


def insert(data: bytes, rng: np.random.Generator) -> bytes:
    at = _place(data, rng)
    return data[:at] + rng.bytes(int(rng.integers(1, 64))) + data[at:]


def nothing(data: bytes, rng: np.random.Generator) -> bytes:
    return b"" if rng.random() < 0.5 else rng.bytes(int(rng.integers(1, 4000)))


def put_number(data: bytes, rng: np.random.Generator) -> bytes:
    """Replace a number in a text."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return insert(data, rng)
    for match in sorted(_chosen(found, rng), key=lambda m: -m.start()):
        data = data[: match.start()] + str(rng.choice(NUMBERS)).encode() + data[match.end() :]
    return data


def nest(data: bytes, rng: np.random.Generator) -> bytes:
    """Put a deep nest into a text."""
    depth = int(rng.choice([50, 900, 3000, 30_000]))
    nests = (
        b"[" * depth + b"]" * depth, b"[" * depth, b'{"a":' * depth + b"1" + b"}" * depth,
        b"<a>" * depth + b"</a>" * depth, b"- " * depth, b"(" * depth, b"{a: " * depth,
    )  # fmt: skip
    at = _place(data, rng)
    return data[:at] + nests[int(rng.integers(len(nests)))] + data[at:]


def bomb(data: bytes, rng: np.random.Generator) -> bytes:
    """Aliases of aliases, entities of entities, long texts, odd encodings."""
    levels = "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
    entities = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 9))
    bombs = (
        b"a0: &a0 [1]\n" + levels.encode() + data,
        data + b"\nz: &z [*z]\n",
        b'<!DOCTYPE s [<!ENTITY e0 "x">' + entities.encode() + b"]><scene>&e8;</scene>",
        b"\xff\xfe" + data.decode("utf-8", "replace").encode("utf-16-le"),
        b'<?xml version="1.0" encoding="no-such"?>' + data, b"\xef\xbb\xbf" + data,
        data.replace(b"1", b"\xc3\x28", 1), data + b"x" * 2_000_000,
        data + b"\nq: !!python/object/apply:os.system ['false']\n",
        data + b"\nq: !!binary '*'\nr: !!int x\n", data.replace(b"\n", b"\r"), data + b"\0",
        data.replace(b'"', b'"\\ud800', 1),
    )  # fmt: skip
    return bombs[int(rng.integers(len(bombs)))]


def tree(data: bytes, rng: np.random.Generator) -> bytes:
    """Change a value of a JSON or YAML tree, and write it soundly."""
    is_json = data.lstrip()[:1] == b"{"
    root = json.loads(data) if is_json else yaml.safe_load(data)
    for _ in range(int(rng.integers(1, 4))):
        places = list(_places(root))
        parent, key = places[int(rng.integers(len(places)))]
        _change(parent, key, rng)
    text = json.dumps(root) if is_json else yaml.safe_dump(root)
    return text.encode("utf-8", "surrogatepass")


def arrays(data: bytes, rng: np.random.Generator) -> bytes:
    """Change an array of an npz file, its header or its compression, and write it soundly."""
    with zipfile.ZipFile(io.BytesIO(data)) as file:
        members = {name: file.read(name) for name in file.namelist()}
    names = list(members)
    name = names[int(rng.integers(len(names)))]
    members = _changed_members(members, name, rng)
    stream = io.BytesIO()
    ways = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2)
    way = ways[int(rng.integers(len(ways)))]
    with zipfile.ZipFile(stream, "w", way) as file:
        for member, content in members.items():
            file.writestr(member, content)
    spoilt = stream.getvalue()
    if rng.random() < 0.05:  # the flag of encryption
        at = spoilt.rfind(b"PK\x01\x02")
        spoilt = spoilt[: at + 8] + b"\x01" + spoilt[at + 9 :]
    return spoilt


def _changed_members(
    members: dict[str, bytes], name: str, rng: np.random.Generator
) -> dict[str, bytes]:
    choice = int(rng.integers(5))
    content = members[name]
    if choice == 0:
        return {k: v for k, v in members.items() if k != name}
    if choice == 1:
        return members | {name: flip_bits(content, rng)}
    if choice == 2:
        return members | {name: _array_bytes(_odd_array(rng))}
    if choice == 3:  # the header promises another shape
        shapes = (b"(99999999999,)", b"(-1,)", b"(2, 2, 2, 2)", b"(1e9,)", b"()", b"(0, 3)")
        shape = shapes[int(rng.integers(len(shapes)))]
        return members | {name: re.sub(rb"\([\d, ]*\)", shape, content, count=1)}
    array = np.load(io.BytesIO(content), allow_pickle=False)
    return members | {name: _array_bytes(_changed_array(array, rng))}


def _changed_array(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    ways: tuple[Callable[[], np.ndarray], ...] = (
        lambda: array[: len(array) // 2] if array.ndim else array,
        lambda: array[None],
        lambda: array.ravel(),
        lambda: array.T,
        lambda: array.astype(str),
        lambda: np.concatenate([array, array]) if array.ndim else array,
        lambda: _some_replaced(array, rng),
        lambda: _some_replaced(array, rng),
        lambda: array.astype(np.complex64) if array.dtype.kind in "fiu" else array,
        lambda: array[..., :1] if array.ndim else array,
    )
    return ways[int(rng.integers(len(ways)))]()


def _some_replaced(array: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    if array.dtype.kind not in "fiu" or not array.size:
        return array
    odd: tuple[float, ...] = (np.nan, np.inf, -np.inf, 1e300, -1e300, 0.0, -1.0, 1e-300)
    if array.dtype.kind != "f":
        odd = (0, -1, 2**31 - 1, 2**15)
    changed = array.astype(np.float64 if array.dtype.kind == "f" else np.int64)
    flat = changed.reshape(-1)
    which = rng.random(flat.size) < rng.choice([1e-3, 0.1, 1.0])
    which[int(rng.integers(flat.size))] = True
    flat[which] = odd[int(rng.integers(len(odd)))]
    return flat.reshape(array.shape)


def _odd_array(rng: np.random.Generator) -> np.ndarray:
    odd: tuple[np.ndarray, ...] = (
        np.zeros(0), np.zeros((0, 2)), np.array(3), np.zeros((1, 1, 1, 1)), np.array(["a", "b"]),
        np.zeros(2, [("a", "f4"), ("b", "i2")]), np.array([b"x"]), np.full(3, np.nan),
        np.array(["2001-01-01"], "datetime64[D]"), np.zeros(3, np.float16),
        np.zeros(3, ">f8"), np.asfortranarray(np.ones((3, 2))), np.zeros((4000, 4000), np.uint8),
    )  # fmt: skip
    return odd[int(rng.integers(len(odd)))]


def _array_bytes(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=False)
    return stream.getvalue()


def _places(node: Any) -> Any:
    """Yield every container of a tree with each of its keys."""
    items = node.items() if isinstance(node, dict) else enumerate(node)
    for key, value in list(items):
        yield node, key
        if isinstance(value, dict | list) and value:
            yield from _places(value)


def _change(parent: Any, key: Any, rng: np.random.Generator) -> None:
    odd: tuple[Any, ...] = (
        None, True, 0, -1, 1e308, -1e308, 1e-308, float("nan"), float("inf"), 2**63, 10**30, "",
        "x" * 300, "../../etc/passwd", "/dev/zero", "a\0b", "\ud800", "\x1b[31m\n", [], {}, [[]],
        [0] * 7, {"a": 1}, [1, [2, [3]]], "1e5", 1.5, "nan", [None] * 3, [[1, 0, 0]] * 3,
    )  # fmt: skip
    choice = rng.random()
    if choice < 0.15:
        del parent[key]
    elif choice < 0.25 and isinstance(parent, list):
        parent.append(parent[key])
    elif choice < 0.3 and isinstance(parent, dict):
        parent[f"{key}x"] = parent[key]
    else:
        parent[key] = odd[int(rng.integers(len(odd)))]


def _place(data: bytes | bytearray, rng: np.random.Generator) -> int:
    return int(rng.integers(max(1, len(data))))


def _chosen(found: list[Any], rng: np.random.Generator) -> list[Any]:
    count = min(len(found), int(rng.integers(1, 4)))
    return [found[int(i)] for i in rng.choice(len(found), count, replace=False)]


OF_BYTES: tuple[Mutate, ...] = (
    flip_bits, flip_in_head, flip_in_head, put_integer, put_integer, cut, delete, repeat, insert,
    nothing,
)  # fmt: skip
OF_TEXT: tuple[Mutate, ...] = (put_number, put_number, put_number, nest, bomb, *OF_BYTES)
OF_TREES: tuple[Mutate, ...] = (tree, tree, tree, tree, *OF_TEXT)
OF_ARRAYS: tuple[Mutate, ...] = (arrays, arrays, arrays, *OF_BYTES)
