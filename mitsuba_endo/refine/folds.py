"""Where a map is torn: depth edges, which no window may span."""

import cv2
import numpy as np
from numpy.typing import NDArray

from .cells import SIDE, Image, Links, any_in

JUMP_PX = 2.0
"""Pattern pixels between neighbours that a surface may make whatever its slope: six standard
deviations of a decoder's noise."""
JUMP_OVER_STEP = 3.0
"""Times the map's median step that a steep surface may make."""


def find_links(q: Image) -> Links:
    """Return which cells belong together, for coordinates (h SIDE, w SIDE, 2), NaN = missing.

    Neighbouring pixels that differ by more than a surface can are torn apart. Missing pixels take
    the coordinate of the nearest known one, and the surface may change the more the farther those
    are: so the sides of a fold are told apart also if the decoder left a gap between them.
    """
    valid = np.asarray(np.isfinite(q[..., 0]))
    filled, away = _nearest(q, valid)
    across, down = (np.asarray(np.abs(np.diff(filled, axis=axis)).max(-1)) for axis in (1, 0))
    steps = np.concatenate([across[valid[:, 1:] & valid[:, :-1]], down[valid[1:] & valid[:-1]]])
    usual = float(np.median(steps)) if steps.size else 0.0
    slack = max(JUMP_PX, JUMP_OVER_STEP * usual)
    gap_across, gap_down = away[:, 1:] + away[:, :-1], away[1:] + away[:-1]
    torn = [np.asarray(step - JUMP_OVER_STEP * usual * gap) > slack
            for step, gap in ((across, gap_across), (down, gap_down))]  # fmt: skip
    return _between_cells(torn[0], torn[1])


def _nearest(q: Image, valid: NDArray[np.bool_]) -> tuple[Image, Image]:
    """Return q with missing pixels filled from the nearest known, and the distance to those."""
    if valid.all() or not valid.any():
        return np.nan_to_num(q), np.zeros(valid.shape, np.float32)
    away, nearest = cv2.distanceTransformWithLabels(
        (~valid).astype(np.uint8), cv2.DIST_L2, 3, labelType=cv2.DIST_LABEL_PIXEL
    )
    labels = np.asarray(nearest, np.intp)
    source = np.zeros(labels.max() + 1, np.intp)
    source[labels[valid]] = np.flatnonzero(valid)
    return q.reshape(-1, 2)[source[labels]], np.asarray(away, np.float32)


def _between_cells(torn_across: NDArray, torn_down: NDArray) -> Links:
    """Return links where no tear lies between cells; one torn inside is linked to none."""
    right = np.pad(torn_across, ((0, 0), (0, 1)))
    below = np.pad(torn_down, ((0, 1), (0, 0)))
    inside = right.copy()
    inside[:, SIDE - 1 :: SIDE] = False
    inside_below = below.copy()
    inside_below[SIDE - 1 :: SIDE] = False
    split = any_in(inside | inside_below)
    h, w = split.shape
    edge_right = np.asarray(right[:, SIDE - 1 :: SIDE].reshape(h, SIDE, w).any(1))
    edge_below = np.asarray(below[SIDE - 1 :: SIDE].reshape(h, w, SIDE).any(2))
    return Links(
        right=~(edge_right[:, :-1] | split[:, :-1] | split[:, 1:]),
        down=~(edge_below[:-1] | split[:-1] | split[1:]),
    )
