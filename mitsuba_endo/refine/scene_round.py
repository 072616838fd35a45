"""A second round of refinement: against the geometry that the first one's calibration found."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from ..records.correspondence import CorrespondenceMap, relative_weight
from .acceptance import judge
from .cells import Image, Links, blend, middles, padded, repeated
from .epipolar_sweep import KnownGeometry, Sweep, sweep
from .image_view import ImageView, view_of
from .iterate import FIRST_BLUR, iterate
from .options import RefineOptions
from .pattern_image import PatternImage
from .refine_map import CORRELATION, RefinedMap, check_start, prepare
from .scattered_light import without_pull
from .uncertainty import cell_covariance

ACROSS = 2.0
"""Pattern pixels that a coordinate may lie off its epipolar line, and ..."""
FROM_MATCH = 5.0
"""... from the best match on it. Of decoded coordinates in their right period 0.3 % lie farther."""
SURE = 0.2
"""Margin of correlation over other matches on the line from which a match is tried."""
MOVED_ACROSS, MOVED_ALONG = 1.0, 3.0
"""Pattern pixels that the image may move a match by; a false one moves off its line by chance."""
PATCH = 60
"""Cells that hang together at least: 540 pixels, a few periods of the coded grid. False matches
come in small patches."""
BELIEVED = 0.5
"""Share of the first map's cells that must agree with the geometry; with less, it is wrong."""


@dataclass(frozen=True, eq=False)
class _Cells:
    """What is taken of both rounds; masks (h, w)."""

    kept: NDArray[np.bool_]
    """Of the first map: cells that the geometry confirms."""
    added: NDArray[np.bool_]
    q: Image
    """(H, W, 2) of what is added."""
    covariance: Image
    """(h, w, 3) likewise."""
    links: Links


def refine_against_scene(
    first: CorrespondenceMap,
    image: NDArray[np.integer] | NDArray[np.floating],
    pattern: PatternImage,
    geometry: KnownGeometry,
    options: RefineOptions | None = None,
) -> RefinedMap:
    """Drop what contradicts a calibration, and read what the decoder could not.

    Every cell's epipolar line leaves a few candidates. Where the image prefers one of them clearly,
    that is refined as any start; it stays if the image confirms it, without the line having forced
    it to, on a patch of some size. Coordinates of the first map that are far off their line, or
    from the best match on it, are dropped; the others stay as they are.

    Args:
        first: a refined map.
        image: (H, W) or (H, W, 3) of the same frame, 8 or 16 bit, or floats where 1 is full scale.
        pattern: what was projected.
        geometry: of the calibration from ``first``, ranges where that has coordinates.
        options: how to refine.

    Raises:
        InputError: as :func:`.refine_map.refine_map`.
    """
    options = replace(options or RefineOptions(), rounds=0)
    check_start(first, image, pattern)
    view = view_of(image, first.valid, options.gamma)
    blur = options.blur or FIRST_BLUR
    matched = sweep(geometry, view, pattern, blur, options.window)
    kept = _confirmed(first, matched)
    share = float(kept.sum() / max(int(_of_cells(first).sum()), 1))
    if share < BELIEVED:
        reason = f"{100 * share:.0f} % of the coordinates agree with the calibration's geometry"
        return RefinedMap(first, 0.0, 0, 0, blur, reason)
    start = _start(first, matched, kept, view)
    cells, blur = _added(start, matched, kept, image, pattern, options)
    return _merged(first, cells, share, blur, CORRELATION * options.window)


def _of_cells(map_: CorrespondenceMap) -> NDArray[np.bool_]:
    """Return the cells (h, w) whose middle has a coordinate."""
    return middles(padded(map_.valid, False))


def _off(q: Image, matched: Sweep) -> tuple[Image, Image]:
    """Return how far (h, w) coordinates (h, w, 2) lie from the match across its line and along."""
    away = q - matched.q
    x, y = matched.along[..., 0], matched.along[..., 1]
    across = np.abs(away[..., 0] * y - away[..., 1] * x)
    return across, np.abs(away[..., 0] * x + away[..., 1] * y)


def _confirmed(first: CorrespondenceMap, matched: Sweep) -> NDArray[np.bool_]:
    """Tell the cells of the first map that lie near their line and the best match on it."""
    q = middles(padded(first.q, np.nan))
    across, along = _off(q, matched)
    return (across < ACROSS) & (np.hypot(across, along) < FROM_MATCH)


def _start(
    first: CorrespondenceMap, matched: Sweep, kept: NDArray[np.bool_], view: ImageView
) -> CorrespondenceMap:
    """Return the first map's confirmed coordinates, and clear matches elsewhere."""
    height, width = view.size
    between = cv2.resize(matched.q, view.light.shape[::-1], interpolation=cv2.INTER_LINEAR)
    old = repeated(kept)[:height, :width] & first.valid
    new = repeated(~kept & (matched.margin > SURE))[:height, :width]
    q = np.where(new[..., None], np.asarray(between)[:height, :width], np.float32(np.nan))
    q = np.where(old[..., None], first.q, q)
    return CorrespondenceMap(q.astype(np.float32), first.name)


def _added(
    start: CorrespondenceMap, matched: Sweep, kept: NDArray[np.bool_],
    image: NDArray[np.integer] | NDArray[np.floating], pattern: PatternImage,
    options: RefineOptions,
) -> tuple[_Cells, float]:  # fmt: skip
    """Refine the start, and return which matches hold, and the pattern's blur."""
    frame, q = prepare(start, image, pattern, options)
    refined = iterate(frame, q, options)
    covariance = cell_covariance(frame, refined)
    verdict = judge(frame, refined, covariance)
    across, along = _off(middles(refined.q), matched)
    added = ~kept & (matched.margin > SURE) & verdict.good
    added &= (across < MOVED_ACROSS) & (along < MOVED_ALONG)
    large = _large(kept | added, frame.links)
    cells = _Cells(
        kept & large, added & large, without_pull(frame, refined), covariance, frame.links
    )
    return cells, refined.blur


def _large(there: NDArray[np.bool_], links: Links) -> NDArray[np.bool_]:
    """Return the cells (h, w) in patches of at least :data:`PATCH`, linked on one surface."""
    index = np.arange(there.size).reshape(there.shape)
    right = links.right & there[:, 1:] & there[:, :-1]
    down = links.down & there[1:] & there[:-1]
    a = np.concatenate([index[:, :-1][right], index[:-1][down]])
    b = np.concatenate([index[:, 1:][right], index[1:][down]])
    graph = sp.coo_array((np.ones(len(a), bool), (a, b)), shape=(there.size, there.size))
    label = connected_components(graph, directed=False)[1]
    size = np.bincount(label[there.ravel()], minlength=label.max(initial=0) + 1)
    return there & (size[label] >= PATCH).reshape(there.shape)


def _merged(
    first: CorrespondenceMap, cells: _Cells, share: float, blur: float, correlation_px: float
) -> RefinedMap:
    height, width = first.q.shape[:2]
    kept = repeated(cells.kept)[:height, :width] & first.valid
    added = repeated(cells.added)[:height, :width] & ~kept
    q = np.where(added[..., None], cells.q[:height, :width], first.q)
    own = blend(cells.covariance, cells.links)[:height, :width]
    old = own if first.covariance is None else first.covariance
    covariance = np.where(added[..., None], own, old)
    gone = ~(kept | added)
    q[gone], covariance[gone] = np.nan, np.nan
    map_ = CorrespondenceMap(
        q.astype(np.float32), first.name, relative_weight(covariance),
        covariance.astype(np.float32), correlation_px,
    )  # fmt: skip
    dropped, grown = int((first.valid & gone).sum()), int((added & ~first.valid).sum())
    return RefinedMap(map_, share, dropped, grown, blur, "")
