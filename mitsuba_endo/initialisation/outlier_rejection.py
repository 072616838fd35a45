"""Rejection of what a correspondence map cannot mean: lone outliers, slipped patches, specks."""

import cv2
import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.robust import robust_std

MEDIAN_SIZE = 5
"""Pixels along the window's side: the most that OpenCV's filter takes of single precision."""
OUTLIER_PX = 2.0
"""A pixel farther than this from its 5x5 median is dropped."""
JUMP_PX = 4.0
"""Neighbours that differ by more than this belong to different patches; a grid period is larger."""
JUMP_OVER_SLOPE = 4.0
"""... unless the map is so steep that its usual slope is a quarter of the difference."""
SMALL_PATCH = 0.05
"""A patch smaller than this share of the largest one is dropped: slips and false islands."""


def clean_map(q: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the mask (H, W) of the correspondences worth using.

    Pixels that differ from their median go first, because lone outliers would cut the map to
    pieces. The median map is then cut at jumps, which isolates depth steps and patches that
    slipped by whole grid periods, and small patches go.

    Args:
        q: (H, W, 2) pattern pixels, NaN = missing.
    """
    finite = np.asarray(np.isfinite(q).all(-1))
    if not finite.any():
        return finite
    smooth = median_filter(q, finite)
    off = np.abs(np.where(finite[..., None], q, smooth) - smooth).max(-1)
    # Noisy maps scatter around their median: the bound grows with the scatter.
    bound = max(OUTLIER_PX, 5 * robust_std(off[finite]))
    return large_patches(smooth, finite & (off <= bound))


def noise_scale(q: NDArray[np.float64], usable: NDArray[np.bool_]) -> float:
    """Return the noise of one component of q, pattern pixels, from second differences along rows.

    They cancel position and slope; noise adds up to sqrt(1 + 4 + 1) of itself. The median leaves
    out jumps. 0 where no three neighbours are usable.
    """
    second = q[:, :-2] - 2 * q[:, 1:-1] + q[:, 2:]
    triple = usable[:, :-2] & usable[:, 1:-1] & usable[:, 2:]
    if not triple.any():
        return 0.0
    return robust_std(second[triple]) / np.sqrt(6)


def median_filter(
    values: NDArray[np.float64], valid: NDArray[np.bool_], size: int = MEDIAN_SIZE
) -> NDArray[np.float32]:
    """Return the median of ``values`` (H, W, C) over size x size pixels (3 or 5).

    Missing pixels take the value of the nearest seen one first, which keeps the filter a fast
    OpenCV call.
    """
    filled = fill_nearest(values.astype(np.float32), valid)
    channels = [
        cv2.medianBlur(np.ascontiguousarray(filled[..., c]), size) for c in range(filled.shape[-1])
    ]
    return np.stack(channels, -1).astype(np.float32, copy=False)


def fill_nearest(values: NDArray, valid: NDArray[np.bool_]) -> NDArray:
    """Return ``values`` (H, W, C) with each pixel outside ``valid`` (H, W) set to its nearest."""
    if valid.all():
        return values
    _, label_image = cv2.distanceTransformWithLabels(
        (~valid).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    labels = np.asarray(label_image, np.intp)
    source = np.zeros(labels.max() + 1, np.intp)
    source[labels[valid]] = np.flatnonzero(valid)
    return values.reshape(-1, values.shape[-1])[source[labels]]


def large_patches(q: NDArray, usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cut ``q`` (H, W, 2) at jumps and return the pixels of ``usable`` in patches large enough."""
    across, down = np.abs(np.diff(q, axis=1)).max(-1), np.abs(np.diff(q, axis=0)).max(-1)
    pair_across = usable[:, 1:] & usable[:, :-1]
    pair_down = usable[1:] & usable[:-1]
    steps = np.concatenate([across[pair_across], down[pair_down]])
    if not steps.size:  # isolated pixels, such as a thinned map: nothing to cut
        return usable
    jump = max(JUMP_PX, JUMP_OVER_SLOPE * float(np.median(steps)))
    patches, sizes = _patches(usable, pair_across & (across <= jump), pair_down & (down <= jump))
    keep = sizes >= SMALL_PATCH * sizes[1:].max(initial=0)
    keep[0] = False
    return keep[patches]


def _patches(
    usable: NDArray[np.bool_], link_across: NDArray[np.bool_], link_down: NDArray[np.bool_]
) -> tuple[NDArray[np.int32], NDArray[np.int_]]:
    """Label the parts of ``usable`` joined by links; return labels (0 = none) and their sizes.

    Pixels sit at even places of an image of twice the size and links between them, so that an
    image labelling sees the links.
    """
    height, width = usable.shape
    grid = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    grid[::2, ::2] = usable
    grid[::2, 1::2] = link_across
    grid[1::2, ::2] = link_down
    label_image = cv2.connectedComponents(grid, connectivity=4, ltype=cv2.CV_32S)[1]
    labels = np.asarray(label_image[::2, ::2], np.int32)
    return labels, np.bincount(labels.ravel())
