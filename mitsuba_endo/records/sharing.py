"""The sharing plan in a rig file: which unknowns frames have in common, and which are held."""

from typing import Any, Literal

from pydantic import model_validator

from .validation import Record

Sharing = Literal["fixed", "shared", "per_frame"]

_FURTHER_BLOCKS: set[str] = set()


def register_sharing(block: str) -> None:
    """Let the sharing plan of rig files name a block of unknowns that is no field of it."""
    if block not in Share.model_fields:
        _FURTHER_BLOCKS.add(block)


class Share(Record):
    """Sharing plan: for each block of unknowns ``fixed``, ``shared`` or ``per_frame``."""

    surface: Sharing = "shared"
    camera_pose: Sharing = "per_frame"
    projector_pose: Sharing = "per_frame"
    focal: Sharing | None = None
    """Default: ``shared`` if ``projector.focal.refine``, else ``fixed``."""
    centre: Sharing | None = None
    """Default: ``fixed``; ``shared`` where it is not given and found beside the middle."""
    aspect: Sharing = "fixed"
    distortion: Sharing = "fixed"

    further: dict[str, Sharing] = {}
    """Of blocks registered by :func:`register_sharing`, which files name like the others."""

    @model_validator(mode="before")
    @classmethod
    def _registered(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        further = {k: v for k, v in data.items() if k in _FURTHER_BLOCKS}
        rest = {k: v for k, v in data.items() if k not in further}
        return {**rest, "further": {**rest.get("further", {}), **further}} if further else rest

    def of(self, block: str) -> Sharing | None:
        """Return the mode that the plan names for a block, or None."""
        return getattr(self, block, None) or self.further.get(block)
