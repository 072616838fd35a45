"""Coordinates that stand for "missing" but are numbers: (0, 0), -1, 65535."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records.correspondence import CorrespondenceMap
from .finding import Finding, frames_named

MIN_PIXELS = 30
"""Pixels that a map must have to be judged, and that hold a repeated value at least. Chosen."""
MIN_SHARE = 0.01
"""Share of a map's correspondences from which a repeated coordinate is looked at."""
MIN_COMPONENT_SHARE = 0.05
"""The same for a repeated x or y alone: whole columns of a surface can be nearly alike."""
TIMES_THE_USUAL = 20
"""Pixels that hold the value, over those that hold the median one: a pattern that is coarse beside
the camera, or whole numbers, repeat their own coordinates evenly."""


@dataclass(frozen=True, eq=False)
class Repeated:
    """A coordinate that stands out by how many pixels hold exactly it."""

    text: str
    """How it reads, e.g. ``(0, 0)`` or ``x = -1``."""
    pixels: NDArray[np.bool_]
    """(H, W) that hold it."""


def missing_values(maps: Sequence[CorrespondenceMap]) -> list[Finding]:
    """Find coordinates that far more pixels share than a surface can explain.

    They are left out. This runs before the other checks, which would take them for outliers.
    """
    by_text: dict[str, dict[int, NDArray[np.bool_]]] = {}
    for k, map_ in enumerate(maps):
        for repeated in repeated_values(map_):
            by_text.setdefault(repeated.text, {})[k] = repeated.pixels
    return [_finding(text, hits, maps) for text, hits in by_text.items()]


def repeated_values(map_: CorrespondenceMap) -> list[Repeated]:
    """Return the values, of both coordinates together or of one, that stand for missing."""
    repeats: list[Repeated] = []
    left = map_.valid
    for text, pixels in _repeated(map_.q, left, MIN_SHARE):
        repeats.append(Repeated(text, pixels))
        left = left & ~pixels
    for axis, name in enumerate("xy"):
        for text, pixels in _repeated(map_.q[..., axis : axis + 1], left, MIN_COMPONENT_SHARE):
            repeats.append(Repeated(f"{name} = {text}", pixels))
            left = left & ~pixels
    return repeats


def _repeated(
    values: NDArray[np.float32], valid: NDArray[np.bool_], min_share: float
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Find repeated values of (H, W, 1 or 2); yield each with its mask."""
    q = np.ascontiguousarray(values[valid], np.float32) + np.float32(0)  # makes -0 to 0
    if len(q) < MIN_PIXELS:
        return
    whole = np.int64 if q.shape[1] == 2 else np.int32
    keys, counts = np.unique(q.view(whole).ravel(), return_counts=True)
    usual = float(np.median(counts)) if len(counts) > 2 else 0.0
    limit = max(MIN_PIXELS, min_share * len(q), TIMES_THE_USUAL * usual)
    for key in keys[counts >= limit]:
        value = np.array([key]).view(np.float32)
        text = ", ".join(f"{v:g}" for v in value)
        yield f"({text})" if len(value) > 1 else text, valid & (values == value).all(-1)


def _finding(
    text: str, hits: dict[int, NDArray[np.bool_]], maps: Sequence[CorrespondenceMap]
) -> Finding:
    share = 100 * max(float(pixels.mean()) for pixels in hits.values())
    return Finding(
        "missing_value",
        f"{share:.2g} % of the pixels hold {text}, which looks like a sign for missing and is "
        "left out",
        f"{frames_named([maps[k].name for k in hits])}: map",
        "write NaN where nothing was decoded",
        unusable=hits,
    )
