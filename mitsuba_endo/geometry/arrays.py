"""The few functions whose name differs between NumPy and Dr.Jit.

Arithmetic operators work on both; a formula that needs more asks :func:`namespace` for it. Dr.Jit
is looked up, never imported: whoever holds one of its arrays has imported it already.
"""

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np

# A scalar or an array of components, of NumPy or of Dr.Jit.
Array = Any

_NUMPY = SimpleNamespace(
    sqrt=np.sqrt, exp=np.exp, sin=np.sin, cos=np.cos, tan=np.tan, atan2=np.arctan2, abs=np.abs,
    where=np.where, detach=lambda x: x, maximum=np.maximum, minimum=np.minimum,
)  # fmt: skip


def namespace(*arrays: Array) -> Any:
    """Return the functions named above for NumPy or for Dr.Jit, whichever ``arrays`` are of."""
    if not any(is_drjit(a) for a in arrays):
        return _NUMPY
    dr = sys.modules["drjit"]
    return SimpleNamespace(
        sqrt=dr.sqrt, exp=dr.exp, sin=dr.sin, cos=dr.cos, tan=dr.tan, atan2=dr.atan2, abs=dr.abs,
        where=dr.select, detach=dr.detach, maximum=dr.maximum, minimum=dr.minimum,
    )  # fmt: skip


def is_drjit(x: Array) -> bool:
    """Tell whether ``x`` is a Dr.Jit array."""
    return type(x).__module__.startswith(("drjit", "mitsuba"))
