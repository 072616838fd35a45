"""The second round of a calibration whose captures are images."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..decoding.image_files import read_frames
from ..records.calibration import Calibration
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from ..refine.image_decoder import grid_of
from ..refine.pattern_image import grid_image
from ..rounds.second_round import second_round
from ..solve.options import Options


def calibrated_again(
    first: Calibration,
    maps: Sequence[CorrespondenceMap],
    images: Sequence[Path],
    pattern: str | None,
    rig: Rig,
    options: Options | None,
    more: Mapping[str, Any],
) -> Calibration:
    """Return the calibration after a second round.

    Args:
        first: of ``maps``.
        maps: named as the images.
        images: files, folders or videos.
        pattern: in the images; None: the coded grid.
        rig: what is known.
        options: how to solve.
        more: further arguments of :func:`..rounds.second_round.second_round`.
    """
    drawn = grid_image(grid_of(pattern, rig))
    pictures = ((frame.name, frame.image) for frame in read_frames(images))
    return second_round(first, maps, pictures, drawn, rig, options, **more)[1]
