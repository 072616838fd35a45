"""What a sequence is made of, before anything is known of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from ..sanity.examine import without_unusable
from ..sanity.finding import Finding
from ..sanity.missing_values import missing_values, repeated_values
from .view import ThinnedMap

LEAST_SHARE = 0.02
"""Of the pixels: a frame with fewer correspondences shows too little to be placed."""
LEAST_CORRESPONDENCES = 200
"""Of a thinned frame, for twelve unknowns. Chosen."""
_SCREENED = 3
"""Every so many-th pixel of a row and column is looked at first for values that stand for missing:
where a share of the frame holds one, these do too."""


@dataclass(frozen=True, eq=False)
class PicturedMap(CorrespondenceMap):
    """A map with the photograph that it was decoded from."""

    picture: NDArray[np.uint8] | None = None
    """(H, W, 3) RGB, as the camera delivered it."""


@dataclass(frozen=True)
class Unread:
    """A frame of which there is no correspondence map."""

    name: str
    reason: str
    """Why, in words."""
    todo: str = ""
    """What to do about it, if something can be done."""


Incoming = CorrespondenceMap | Unread


def check_size(map_: CorrespondenceMap, rig: Rig) -> None:
    """Refuse a map of another size than the camera's.

    Raises:
        InputError: names the frame.
    """
    height, width = map_.q.shape[:2]
    if (width, height) != (rig.camera.width, rig.camera.height):
        raise InputError(
            f"is {width} x {height} pixels and the rig's camera.width x camera.height "
            f"{rig.camera.width} x {rig.camera.height}",
            f"frame {map_.name}", "give the frames of one camera, and its rig",
        )  # fmt: skip


def without_missing(map_: CorrespondenceMap) -> tuple[CorrespondenceMap, list[Finding]]:
    """Return a map without numbers that stand for missing, and what was found of them."""
    few = CorrespondenceMap(map_.q[::_SCREENED, ::_SCREENED], map_.name)
    if not repeated_values(few):
        return map_, []
    findings = missing_values([map_])
    return without_unusable([map_], findings)[0], findings


def shortage(view: ThinnedMap) -> str:
    """Return why a frame shows too little to be placed, in words; empty if it does not."""
    count = int(view.usable.sum())
    if count >= max(LEAST_CORRESPONDENCES, LEAST_SHARE * view.usable.size):
        return ""
    return f"it has {count} usable correspondences"


def check_enough(waiting: Sequence[Unread | ThinnedMap]) -> None:
    """Refuse first frames of which none can be tracked.

    Raises:
        InputError: there are no frames, only one, or none shows enough.
    """
    if not waiting:
        raise InputError("there are no frames", todo="give a video, a folder or maps")
    first = waiting[0]
    if len(waiting) == 1:
        raise InputError("one frame is no sequence", first.name, "use the command calibrate")
    if isinstance(first, Unread) and all(isinstance(v, Unread) for v in waiting):
        raise InputError(
            f"no frame shows enough of the pattern (the first: {first.reason})", first.name,
            first.todo or "check the pattern, light and focus",
        )  # fmt: skip
