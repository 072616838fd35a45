"""From a decoded map and its image to a refined map with covariances."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records.correspondence import CorrespondenceMap, relative_weight
from .acceptance import Verdict, judge
from .cells import Image, Links, any_in, blend, padded, repeated
from .folds import find_links
from .growth import Grown, grow
from .image_view import view_of
from .iterate import Comparison, Refined, iterate
from .options import RefineOptions
from .pattern_image import PatternImage
from .scattered_light import without_pull
from .smoother import Smoother
from .start_smoothing import smoothed_start
from .uncertainty import cell_covariance
from .windows import Windows

WIDER = 2.0
"""Windows that smooth start and correction over those of the regression."""
CORRELATION = 1.2
"""Standard deviation of the errors' Gaussian autocorrelation over that of the window, measured on
photographs: 0.68 at one window's standard deviation, 0.3 at two."""
LEAST = 0.02
"""Share of the map's pixels that the image must confirm; with less, it is not the map's image."""
STRAY = 0.05
"""Share of the map's coordinates that may lie beyond the pattern: a decoder's outliers."""
FLOOR = 1e-3
"""Least variance of a start's coordinate, pattern pixels squared."""


@dataclass(frozen=True, eq=False)
class RefinedMap:
    """A refined map and how far the refinement went."""

    map: CorrespondenceMap
    """Coordinates with weights; covariance and correlation where anything was refined."""
    refined: float
    """Share of the start's pixels that the image confirmed."""
    dropped: int
    """Pixels of the start left out: the image shows another period there."""
    grown: int
    """Pixels added where the start had none."""
    blur: float
    """Of the pattern that was compared, pattern pixels."""
    reason: str
    """Why nothing was refined and the start is returned; empty if something was."""


def refine_map(
    start: CorrespondenceMap,
    image: NDArray[np.integer] | NDArray[np.floating],
    pattern: PatternImage,
    options: RefineOptions | None = None,
) -> RefinedMap:
    """Refine a map's coordinates on the image that it came from.

    Where the image does not confirm a coordinate, that of the start stays with a variance of its
    own: the start's weight on the scale of its deviation from what was refined. Coordinates that
    are a whole period off by the image are dropped, and the map grows a little where it is sure.

    Args:
        start: a decoder's map; its weight is used if it has one.
        image: (H, W) or (H, W, 3) of the same frame, 8 or 16 bit, or floats where 1 is full scale.
        pattern: what was projected.
        options: how.

    Raises:
        InputError: the image is not of the map's size or not an image, or the map reaches beyond
            the pattern.
    """
    options = options or RefineOptions()
    check_start(start, image, pattern)
    frame, q = prepare(start, image, pattern, options)
    refined = iterate(frame, q, options)
    covariance = cell_covariance(frame, refined)
    verdict = judge(frame, refined, covariance)
    share = float(repeated(verdict.good)[padded(start.valid, False)].mean())
    if share < LEAST:
        reason = f"the image confirms {100 * share:.1f} % of the map's pixels"
        return RefinedMap(start, 0.0, 0, 0, refined.blur, reason)
    grown = _grown(frame, refined, covariance, verdict, options)
    return _merged(start, frame.links, grown, verdict, share, options, refined.blur)


def check_start(start: CorrespondenceMap, image: NDArray, pattern: PatternImage) -> None:
    if image.shape[:2] != start.q.shape[:2]:
        raise InputError(
            f"the image is {image.shape[1]} x {image.shape[0]} pixels and the map "
            f"{start.q.shape[1]} x {start.q.shape[0]}", start.name,
            "give the image that the map was decoded from",
        )  # fmt: skip
    coordinates = start.q[start.valid]
    if not len(coordinates):
        raise InputError("the map has no finite value", start.name, "check how it was decoded")
    low, high = coordinates.min(0), coordinates.max(0)
    size = np.array([pattern.width, pattern.height])
    if float(np.mean(~pattern.holds(coordinates))) > STRAY:
        raise InputError(
            f"its coordinates reach from ({low[0]:.1f}, {low[1]:.1f}) to ({high[0]:.1f}, "
            f"{high[1]:.1f}) and the pattern has {size[0]} x {size[1]} pixels",
            start.name, "give the pattern that was projected",
        )  # fmt: skip


def prepare(
    start: CorrespondenceMap, image: NDArray, pattern: PatternImage, options: RefineOptions
) -> tuple[Comparison, Image]:
    """Return what stays the same over all iterations, and the smoothed start (H, W, 2)."""
    view = view_of(image, start.valid, options.gamma)
    q = padded(start.q.astype(np.float32), np.nan)
    valid = np.asarray(np.isfinite(q).all(-1))
    links = find_links(q)
    windows = Windows(links, options.window)
    weight = valid.astype(np.float32)
    wide = Smoother(Windows(links, WIDER * options.window), links, weight)
    smooth = smoothed_start(np.where(valid[..., None], q, 0), weight, links, windows, wide)
    usable = (valid & view.clear).astype(np.float32)
    return Comparison(view, usable, links, windows, wide, pattern), smooth


def _grown(
    frame: Comparison, refined: Refined, covariance: Image, verdict: Verdict, options: RefineOptions
) -> Grown:
    none = np.zeros_like(verdict.good)
    grown = Grown(without_pull(frame, refined), covariance, verdict.good, none)
    # What the start has and the image does not confirm keeps the start's coordinate.
    barred = any_in(frame.usable > 0)
    for _ in range(options.rounds):
        before = int(grown.added.sum())
        grown = grow(frame, grown, options, refined.blur, barred)
        if int(grown.added.sum()) == before:
            break
    return grown


def _merged(
    start: CorrespondenceMap, links: Links, grown: Grown, verdict: Verdict, share: float,
    options: RefineOptions, blur: float,
) -> RefinedMap:  # fmt: skip
    """Put together what was refined, what stays the start's, and what was added."""
    height, width = start.q.shape[:2]
    valid, added = start.valid, repeated(grown.added)[:height, :width] & ~start.valid
    good = repeated(grown.good)[:height, :width] & valid
    beaten = repeated(verdict.beaten)[:height, :width] & valid & ~good
    confirmed = good | added
    q = np.where(confirmed[..., None], grown.q[:height, :width], start.q)
    q[beaten] = np.nan
    covariance = blend(grown.covariance, links)[:height, :width]
    covariance = np.where(confirmed[..., None], covariance, _of_start(start, q, good))
    covariance[~np.isfinite(q[..., 0])] = np.nan
    map_ = CorrespondenceMap(
        q.astype(np.float32), start.name, relative_weight(covariance),
        covariance.astype(np.float32), CORRELATION * options.window,
    )  # fmt: skip
    return RefinedMap(map_, share, int(beaten.sum()), int(added.sum()), blur, "")


def _of_start(start: CorrespondenceMap, q: Image, good: NDArray[np.bool_]) -> Image:
    """Return covariances (H, W, 3) of the start's own coordinates.

    Its weight says how variances compare; the median squared deviation from refined coordinates,
    over that of two Gaussian variables, how large they are.
    """
    weight = np.ones(q.shape[:2]) if start.weight is None else np.maximum(start.weight, 1e-6)
    squared = ((start.q - q) ** 2).sum(-1)[good] * weight[good]
    variance = max(float(np.median(squared)) / (2 * np.log(2)), FLOOR) / weight
    return np.stack([variance, np.zeros_like(variance), variance], -1)
