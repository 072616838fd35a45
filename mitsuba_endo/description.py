"""Descriptions of generated things: ``KIND:NAME?a=1&b=2``."""

from urllib.parse import parse_qsl

from .errors import InputError


def read_description(value: str, kind: str, where: str) -> tuple[str, dict[str, str]]:
    """Return name and settings of a description of this kind.

    Raises:
        InputError: it cannot be read, or is of another kind; names ``where``.
    """
    before, colon, description = value.partition(":")
    name, _, query = description.partition("?")
    try:
        if before != kind or not colon:
            raise ValueError
        return name, dict(parse_qsl(query, strict_parsing=True)) if query else {}
    except ValueError:
        raise InputError(
            f"{value!r} cannot be read", where, f"write it as {kind}:NAME?name=value&name=value"
        ) from None
