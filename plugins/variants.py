"""Making one plugin class per Mitsuba variant.

Each variant has its own base classes and nanobind allows a class a single base, so a plugin is
written as a plain template whose members are copied onto the base of the active variant.
"""

import functools
from typing import Any

import numpy as np

from mitsuba_endo.rendering.axes import is_rigid
from mitsuba_endo.rendering.untyped import dr, mi

_NOT_COPIED = ("__dict__", "__weakref__")


def variant_class(template: type, base: str) -> type:
    """Return the class of ``template`` for the active variant, deriving from ``mi.<base>``."""
    return _build(template, base, mi.variant())


@functools.cache
def _build(template: type, base: str, variant: str | None) -> type:
    members = {k: v for k, v in vars(template).items() if k not in _NOT_COPIED}
    return type(template.__name__, (getattr(mi, base),), members)


def read_to_world(props: Any) -> Any:
    """Return the ``to_world`` of a plugin's properties; RuntimeError unless it is rigid."""
    to_world = props.get("to_world", mi.ScalarAffineTransform4d())
    if not is_rigid(to_world.matrix):
        raise RuntimeError('"to_world" must be a rotation and a translation, without any scale')
    matrix = np.array(
        to_world.matrix, np.float32
    )  # XML gives double precision, variants use single
    return mi.AffineTransform4f(mi.ScalarAffineTransform4f(matrix))


def make_opaque(*values: Any) -> None:
    """Keep parameters out of the generated code, so that changing them compiles nothing anew."""
    if not is_scalar():
        dr.make_opaque(*values)


def pointer_to(emitter: Any) -> Any:
    """Return what a direction sample stores to name its emitter, None for a sensor's."""
    return emitter if is_scalar() else mi.EmitterPtr(emitter)


def is_scalar() -> bool:
    """Tell whether the active variant computes one value at a time."""
    return mi.variant().startswith("scalar")
