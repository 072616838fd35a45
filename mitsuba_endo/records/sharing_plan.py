"""Entries of a rig's sharing plan replaced by what a caller asks for."""

from collections.abc import Mapping

from .rig import Rig, Share
from .validation import validate


def with_plan(rig: Rig, plan: Mapping[str, str], where: str) -> Rig:
    """Return the rig with entries of its sharing plan replaced, e.g. ``{"focal": "fixed"}``.

    Args:
        rig: what is known.
        plan: mode of every block that shall have another.
        where: the argument or option, for messages.

    Raises:
        InputError: an unknown block or mode.
    """
    share = validate(Share, {**rig.share.model_dump(), **plan}, where)
    return rig.model_copy(update={"share": share})
