"""From refined cells into the dark and the holes beside them: extend, refine, test."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from .acceptance import judge
from .cells import Image, middles, repeated
from .iterate import Comparison, iterate
from .options import RefineOptions
from .scattered_light import without_pull
from .smoother import Smoother
from .uncertainty import cell_covariance

STRIDE = 2
"""Cells that a map grows by at once: half a period, so that an extrapolation cannot slip."""
MOVED = 2.0
"""Pattern pixels that the image may move an extrapolated coordinate by: a sixth of the coded grid's
period."""
CLEAR = 0.9
"""Share of the median correlation, and ..."""
SURE = 0.5
"""... of the median margin to the best alternative, that a grown cell must reach."""
KNOWN = 0.4
"""Largest standard deviation of a grown cell, pattern pixels: at folds nothing else tells that the
surface ended."""
STEPS = 2
"""Iterations of a round: what grows begins near."""


@dataclass(frozen=True, eq=False)
class Grown:
    """A map with the cells that were added."""

    q: Image
    """(H, W, 2) coordinates."""
    covariance: Image
    """(h, w, 3)."""
    good: NDArray[np.bool_]
    """(h, w) cells that the image confirms."""
    added: NDArray[np.bool_]
    """(h, w) of them, those that the start did not have."""


def grow(
    frame: Comparison, grown: Grown, options: RefineOptions, blur: float, barred: NDArray[np.bool_]
) -> Grown:
    """Grow a map by up to :data:`STRIDE` cells all around.

    A cell is added if its window sees the pattern, the image moves it little, and it fits clearly
    better than a period away; else it is left as it was.

    Args:
        frame: of the image; its usable pixels are those of the start.
        grown: the map so far.
        options: of the refinement.
        blur: of the pattern.
        barred: (h, w) cells that must not be added.
    """
    side = 2 * STRIDE + 1
    near = cv2.dilate(grown.good.astype(np.uint8), np.ones((side, side), np.uint8)) > 0
    wanted = np.asarray(near) & ~grown.good & ~barred
    if not wanted.any():
        return grown
    sure = repeated(grown.good).astype(np.float32)
    smoother = Smoother(frame.windows, frame.links, sure)
    wanted &= smoother.support.reshape(wanted.shape) > 0.5
    start = np.where(
        repeated(wanted)[..., None], smoother.pixels(grown.q * sure[..., None]), grown.q
    )
    usable = (repeated(grown.good | wanted) & frame.view.clear).astype(np.float32)
    wider = replace(frame, usable=usable)
    refined = iterate(
        wider, start.astype(np.float32), replace(options, iterations=STEPS, blur=blur)
    )
    covariance = cell_covariance(wider, refined)
    verdict = judge(wider, refined, covariance)
    added = wanted & verdict.good & (np.linalg.norm(refined.moved, axis=-1) < MOVED)
    for value, share in ((verdict.correlation, CLEAR), (verdict.margin, SURE)):
        added &= value > share * float(np.median(value[grown.good]))
    added &= np.maximum(covariance[..., 0], covariance[..., 2]) < KNOWN**2
    added &= frame.pattern.holds(middles(refined.q))
    q = np.where(repeated(added)[..., None], without_pull(wider, refined), grown.q)
    kept = np.where(added[..., None], covariance, grown.covariance)
    return Grown(q, kept, grown.good | added, grown.added | added)
