"""Making one plugin class per Mitsuba variant.

Each variant has its own base classes and nanobind allows a class a single base, so a plugin is
written as a plain template whose members are copied onto the base of the active variant.
"""

import functools
from typing import Any

import numpy as np

from mitsuba_endo.rendering.axes import is_rigid
from mitsuba_endo.rendering.mitsuba_modules import dr, mi

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
    with np.errstate(over="ignore"):  # the check below tells it better
        matrix = np.array(to_world.matrix, np.float32)  # XML gives double precision
    if not np.isfinite(matrix).all():
        raise RuntimeError('"to_world" must be finite in single precision')
    return mi.AffineTransform4f(mi.ScalarAffineTransform4f(matrix))


def read_number(props: Any, name: str, default: float | None = None, positive: bool = False) -> Any:
    """Return a number of a plugin's properties in single precision, as the variant's ``Float``.

    Without a default the scene must give it. RuntimeError unless it is finite, and above 0 where
    ``positive``: a projection with such a value renders nothing that makes sense, silently.
    """
    given = props[name] if default is None else props.get(name, default)
    value = mi.Float(given)
    if not dr.all(dr.isfinite(value) & (value > 0 if positive else True)):
        wanted = "a finite number above 0" if positive else "a finite number"
        raise RuntimeError(f'"{name}" must be {wanted}, got {given}')
    return value


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
