"""Weights of the coordinates, on a scale that noise and prior can be told in."""

from dataclasses import replace

import numpy as np

from ...records.correspondence import CorrespondenceMap


def balanced(maps: list[CorrespondenceMap]) -> list[CorrespondenceMap]:
    """Return the maps with weights whose mean over all frames is one, if any has weights.

    Only ratios of weights are known. Noise, its robust scale and the surface's prior are those of
    one coordinate: relative to the best, they would depend on a single pixel, and the prior would
    outweigh data that are mostly worse.
    """
    if all(m.weight is None for m in maps):
        return maps
    weights = [np.where(m.valid, 1.0 if m.weight is None else m.weight, 0.0) for m in maps]
    mean = sum(w.sum() for w in weights) / sum(int(m.valid.sum()) for m in maps)
    return [
        replace(m, weight=(w / mean).astype(np.float32)) for m, w in zip(maps, weights, strict=True)
    ]
