"""Mitsuba plugins of mitsuba_endo, one a file (installed as ``mitsuba_endo.plugins``).

A plugin module offers ``register(mi)``; :func:`register_all` calls them for the active variant and
again whenever the variant changes, because Mitsuba registers Python plugins per variant and loads
scenes without them, silently, after a switch back.
"""

import importlib

MODULES = ("doe_projector", "projector_coords", "endoscope", "vessels", "tissue_relief")

_callback_installed = False


def register_all() -> None:
    """Register the plugins now and on every later change of variant."""
    global _callback_installed
    import mitsuba as mi

    if not _callback_installed:
        mi.detail.add_variant_callback(_register)
        _callback_installed = True
    if mi.variant() is not None:
        _register(None, mi.variant())


def ensure_registered() -> None:
    """Register the plugins, unless that has been done."""
    if not _callback_installed:
        register_all()


def _register(old: str | None, new: str | None) -> None:
    import mitsuba as mi

    for name in MODULES:
        importlib.import_module(f"{__name__}.{name}").register(mi)
