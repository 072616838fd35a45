"""What a sequence is made of, before anything is known of it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from .view import ThinnedMap

LEAST_SHARE = 0.02
"""Of the pixels: a frame with fewer correspondences shows too little to be placed."""
LEAST_CORRESPONDENCES = 200
"""Of a thinned frame, for twelve unknowns. Chosen."""


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


def shortage(view: ThinnedMap) -> str:
    """Return why a frame shows too little to be placed, in words; empty if it does not."""
    count = int(view.usable.sum())
    if count >= max(LEAST_CORRESPONDENCES, LEAST_SHARE * view.usable.size):
        return ""
    return f"it has {count} usable correspondences"
