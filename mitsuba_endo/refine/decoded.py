"""Refinement of what the coded grid's decoder found, with its defaults."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from ..decoding.grid.decode import DecodedGrid
from ..decoding.grid_pattern import CodedGrid
from ..records.correspondence import CorrespondenceMap
from .pattern_image import grid_image
from .refine_map import RefinedMap, refine_map

RIGHT = 0.1
"""Periods that a coordinate may be off where the confidence says that it is right."""


@dataclass(frozen=True, eq=False)
class DecodedMap:
    """A decoded map as it is written."""

    map: CorrespondenceMap
    confidence: NDArray[np.float32]
    """(H, W) probability that the coordinate is right to a tenth of a period, 0 = not known."""
    refined: RefinedMap | None
    """How the refinement went; None if it was not wanted or nothing was decoded."""


def decoded_map(
    image: NDArray[np.integer] | NDArray[np.floating],
    decoded: DecodedGrid,
    grid: CodedGrid,
    name: str,
    *,
    refine: bool,
) -> DecodedMap:
    """Return the map of a decoded image, refined on the image if wanted.

    Args:
        image: that was decoded.
        decoded: what the decoder found.
        grid: the pattern.
        name: of the frame.
        refine: whether to.
    """
    plain = CorrespondenceMap(decoded.q, name, decoded.weight)
    if not refine or decoded.reason:
        return DecodedMap(plain, decoded.confidence, None)
    refined = refine_map(plain, image, grid_image(grid))
    confidence = confidence_of(refined.map, decoded.confidence, grid.period)
    return DecodedMap(refined.map, confidence, refined)


def confidence_of(
    map_: CorrespondenceMap, before: NDArray[np.floating], period: float
) -> NDArray[np.float32]:
    """Return the confidences (H, W) of a refined map.

    Args:
        map_: refined.
        before: (H, W) the decoder's, 0 where it found nothing; there the covariance gives it.
        period: of the pattern, pattern pixels.
    """
    confidence = np.where(map_.valid, before, 0)
    if map_.covariance is None:
        return confidence.astype(np.float32)
    grown = map_.valid & (before == 0)
    spread = np.sqrt(2 * map_.covariance[grown][:, [0, 2]])
    confidence[grown] = erf(RIGHT * period / spread).prod(-1)
    return confidence.astype(np.float32)
