"""How frames are read from files."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..decoding.masks import Masks, check_mask
from ..errors import InputError
from ..records.map_convention import MapConvention, read_map_convention
from ..records.rig import Rig


@dataclass(frozen=True)
class FrameReading:
    """What is said of the files; the same for all frames of a sequence."""

    pattern: str | None = None
    """In the images; None: the default one."""
    refine: bool = True
    """Whether decoded coordinates are refined on the image."""
    map_convention: str = ""
    """Words on how the maps count, see :mod:`..records.map_convention`."""
    mask: str | None = None
    """An image whose white pixels are used, for all frames, or a folder of one for each."""

    def check(self, rig: Rig, *, maps: bool) -> None:
        """Refuse, before any work, what does not suit the files.

        Args:
            rig: size of the image.
            maps: whether the files are maps, not images.

        Raises:
            InputError: an option of images with maps or of maps with images, words that are
                unknown, no mask, or one of another size.
        """
        images = (("--pattern", self.pattern is not None), ("--no-refine", not self.refine))
        others = images if maps else (("--map-convention", bool(self.map_convention)),)
        what = "is for images, and maps are given" if maps else "is for maps, and images are given"
        for name, given in others:
            if given:
                raise InputError(what, name, "leave it out")
        self.convention.affine((rig.projector.width, rig.projector.height))
        masks = self.masks
        if masks is not None and masks.common:
            check_mask(masks.of(""), (rig.camera.height, rig.camera.width), str(masks.path))

    @cached_property
    def convention(self) -> MapConvention:
        """Of the maps."""
        return read_map_convention(self.map_convention)

    @cached_property
    def masks(self) -> Masks | None:
        """Of the pixels to use."""
        return None if self.mask is None else Masks.at(Path(self.mask))


AS_IT_IS = FrameReading()
