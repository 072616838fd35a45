"""The metadata of an ONNX file, read without ONNX's own library.

An ONNX file is a Protocol Buffers message (https://protobuf.dev/programming-guides/encoding) whose
field 14 repeats pairs of key (1) and value (2): ``ModelProto.metadata_props`` of onnx.proto.
"""

from collections.abc import Iterator

METADATA = 14
FIXED = {1: 8, 5: 4}
"""Bytes of the wire types of fixed length."""


def metadata(model: bytes) -> dict[str, str]:
    """Return the metadata of a model; empty if there is none, or if it is no ONNX file."""
    found = {}
    try:
        for number, content in _fields(model):
            if number == METADATA:
                pair = dict(_fields(content))
                found[pair[1].decode()] = pair[2].decode()
    except (IndexError, KeyError, UnicodeDecodeError, ValueError):
        return {}
    return found


def _fields(message: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the number and the content of each field that has a length."""
    at = 0
    while at < len(message):
        tag, at = _varint(message, at)
        kind = tag & 7
        if kind == 0:
            at = _varint(message, at)[1]
        elif kind == 2:
            length, at = _varint(message, at)
            if at + length > len(message):
                raise ValueError("cut short")
            yield tag >> 3, message[at : at + length]
            at += length
        else:
            at += FIXED[kind]


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """Return a number of seven bits a byte, lowest first, and where the next begins."""
    value = shift = 0
    while True:
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
