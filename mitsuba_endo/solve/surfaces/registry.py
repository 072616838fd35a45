"""Kinds of surfaces by name."""

from typing import TypeVar

from .surface import Surface

S = TypeVar("S", bound=Surface)

SURFACES: dict[str, type[Surface]] = {}


def register_surface(cls: type[S]) -> type[S]:
    """Class decorator that makes a kind of surface available under its ``kind``."""
    SURFACES[cls.kind] = cls
    return cls
