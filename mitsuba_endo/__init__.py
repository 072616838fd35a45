"""Target-free calibration of camera-projector pairs by differentiable rendering.

    import mitsuba_endo as me

    result = me.calibrate("photograph.png", "rig.yaml")
    print(result.verdict)
    depth = result.depth()

Importing the package loads nothing; each name below loads what it needs when first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import FramePose, Result, TrackedSequence, calibrate, decode, load, render, track
    from .errors import InputError
    from .records.rig import Rig

__version__ = "0.1.0"
__all__ = [
    "FramePose", "InputError", "Result", "Rig", "TrackedSequence", "__version__", "calibrate",
    "decode", "load", "render", "track",
]  # fmt: skip
_HOMES = {"InputError": ".errors", "Rig": ".records.rig"}
"""Modules of the names that are not in :mod:`.api`."""


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES.get(name, ".api"), __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
