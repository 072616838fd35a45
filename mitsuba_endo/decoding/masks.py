"""Masks of pixels to use: tools, overlays and the frame's border are left out by them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records.correspondence import CorrespondenceMap
from .image_files import images_of, read_image

OPTION = "--mask"
ENDINGS = ("", "_mask", "-mask", ".mask")
"""After a frame's name, of the mask that belongs to it."""


@dataclass(frozen=True)
class Masks:
    """One image for all frames, or one for each; white pixels are used."""

    path: Path
    common: bool
    """One for all frames."""

    @classmethod
    def at(cls, path: Path) -> "Masks":
        """Return the masks at a path: an image, or a folder of images named after the frames.

        Raises:
            InputError: it is neither.
        """
        if path.is_dir():
            images_of(path)  # refuses an empty folder
            return cls(path, common=False)
        read_mask(path)
        return cls(path, common=True)

    def of(self, frame: str) -> NDArray[np.bool_]:
        """Return the pixels (H, W) of a frame to use.

        Args:
            frame: its name, with or without suffix.

        Raises:
            InputError: a folder has no mask of this name, or a file is no mask.
        """
        if self.common:
            return read_mask(self.path)
        # Frames of one name in several folders are called by their folders too.
        folder, stem = self.path / Path(frame).parent, Path(frame).stem
        names = [name + ending for name in (stem, Path(frame).name) for ending in ENDINGS]
        inside = images_of(folder) if folder.is_dir() else []
        matches = [path for path in inside if path.stem in names]
        if len(matches) != 1:
            what = "several masks" if matches else "no mask"
            todo = f"name one {Path(frame).with_suffix('.png')}, or give one for all frames"
            raise InputError(f"holds {what} of frame {frame}", str(self.path), todo)
        return read_mask(matches[0], one_of_many=True)

    def applied(self, map_: CorrespondenceMap) -> CorrespondenceMap:
        """Return a map without the pixels that its mask leaves out.

        Raises:
            InputError: as :meth:`of`, another size, or no pixel is left.
        """
        used = self.of(map_.name)
        check_mask(used, map_.q.shape[:2], str(self.path))
        return replace(map_, q=np.where(used[..., None], map_.q, np.float32(np.nan)))


def check_mask(used: NDArray[np.bool_], shape: Sequence[int], source: str) -> None:
    """Refuse a mask of another size than an image's (H, W).

    Raises:
        InputError: names both sizes.
    """
    if used.shape != tuple(shape):
        (rows, columns), (height, width) = used.shape, shape
        what = f"the mask is {columns} x {rows} pixels and the frame {width} x {height}"
        raise InputError(what, source, "give it at the frame's size")


def read_mask(path: Path, *, one_of_many: bool = False) -> NDArray[np.bool_]:
    """Read the pixels (H, W) to use: those brighter than half of the brightest.

    Args:
        path: an image.
        one_of_many: whether it is of one frame, which may be white all over where no tool is seen.

    Raises:
        InputError: it cannot be read, is as gray as a photograph, or leaves no pixel or all.
    """
    light = read_image(path).max(-1).astype(np.float32)
    dark, bright = float(light.min()), float(light.max())
    if one_of_many and dark == bright > 0:
        return np.ones(light.shape, bool)
    if dark == bright:
        raise InputError("leaves out no pixel or all", str(path), "draw what to use in white")
    between = (light - dark) / (bright - dark)
    # Edges may be smooth, and JPEG leaves traces; a photograph is gray all over.
    if ((between > GRAY) & (between < 1 - GRAY)).mean() > MOST_GRAY:
        todo = "draw what to use in white and all else in black"
        raise InputError("is no mask: it has many gray pixels", str(path), todo)
    return between > 0.5


GRAY, MOST_GRAY = 0.1, 0.2
"""Distance from black and white, of their difference, and the share of such pixels. Chosen."""
