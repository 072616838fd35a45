"""From an image of the coded grid to its map: size, grid, network and refinement in one place."""

from dataclasses import dataclass
from pathlib import Path

from ..decoding.grid.decode import DecodedGrid, decode_image
from ..decoding.grid_pattern import CodedGrid
from ..decoding.image_files import ImageFrame
from ..decoding.network import load_network
from ..decoding.pattern_option import coded_grid
from ..errors import InputError
from ..records.rig import Rig
from .decoded import DecodedMap, decoded_map

PATTERN = "pattern:coded"
"""The pattern in images where nobody says another."""


@dataclass(frozen=True, eq=False)
class DecodedImage:
    """What was found in an image."""

    grid: DecodedGrid
    """Its ``reason`` says why there is no map, if there is none."""
    map: DecodedMap


def grid_of(pattern: str | None, rig: Rig) -> CodedGrid:
    """Return the coded grid that a rig projects.

    Args:
        pattern: as ``--pattern`` takes it; None: :data:`PATTERN`.
        rig: size of the pattern.

    Raises:
        InputError: a wrong pattern.
    """
    return coded_grid(pattern or PATTERN, rig.projector.width, rig.projector.height)


class ImageDecoder:
    """Decodes images of one rig, one after the other; grid and network are made once."""

    def __init__(
        self, rig: Rig, pattern: str | None = None, weights: Path | None = None, *, refine: bool
    ) -> None:
        """Load the network.

        Args:
            rig: sizes of image and pattern.
            pattern: in the images, as ``--pattern`` takes it; None: :data:`PATTERN`.
            weights: another network's ONNX file.
            refine: whether coordinates are refined on the images.

        Raises:
            InputError: a wrong pattern or network.
        """
        self._rig, self._refine = rig, refine
        self._grid = grid_of(pattern, rig)
        self._network = load_network(weights)

    def decode(self, frame: ImageFrame) -> DecodedImage:
        """Decode an image.

        Raises:
            InputError: it is of another size than the rig's camera.
        """
        _check_size(frame, self._rig)
        decoded = decode_image(frame.image, self._network, self._grid)
        map_ = decoded_map(frame.image, decoded, self._grid, frame.name, refine=self._refine)
        return DecodedImage(decoded, map_)


def _check_size(frame: ImageFrame, rig: Rig) -> None:
    height, width = frame.image.shape[:2]
    if (width, height) != (rig.camera.width, rig.camera.height):
        raise InputError(
            f"is {width} x {height} pixels and the rig's camera.width x camera.height "
            f"{rig.camera.width} x {rig.camera.height}",
            frame.source, "give the rig of the camera that took it",
        )  # fmt: skip
