"""Samples of a stack's images, to try hypotheses on."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .axis_images import AxisImages, axis_images, labels_needed
from .sample_map import AxisMap
from .stack_images import StackSource
from .stack_plan import AXES, Axis, StackPlan

TILE, TILES, STRIDE = 96, 12, 3
"""Pixels of a tile's side, tiles of an image, and pixels from one sample to the next: odd, or
samples of stripes as wide as a pixel would all lie in bright ones."""
BALANCE = 0.2
"""Of a pixel's contrast, by which a bit and its inverse, or the steps of a period, may miss the
mean of the brightest and the darkest image."""
BALANCED = 2000
"""Lit samples at which that is seen."""
CONSTANT, FINEST = 0.01, 2
"""Of the samples, that differ at least from the others in each of so many finest bits."""


@dataclass(eq=False)
class StackSamples:
    """Tiles of the images, where they are lit."""

    images: NDArray[np.float32]
    """(N, T, h, w) brightness."""
    noise: float
    lit: NDArray[np.bool_]
    """(T, h, w)"""
    cache: "dict[tuple[object, ...], AxisMap]" = field(default_factory=dict)
    """Coordinates of axes that were decoded before."""

    @cached_property
    def light(self) -> NDArray[np.float32]:
        """(N, n) brightness of some lit samples, from -1 (the darkest image) to 1."""
        lit = self.images[:, self.lit]
        lit = lit[:, :: max(1, lit.shape[1] // BALANCED)]
        high, low = lit.max(0), lit.min(0)
        return (2 * lit - high - low) / np.maximum(high - low, np.float32(1e-6))

    def balanced(self, plan: StackPlan, image_index: dict[str, int]) -> bool:
        """Tell whether each bit and its inverse, and the steps of each period, cancel out."""
        groups = [steps for axis in AXES for steps in plan.phase_labels(axis)]
        if plan.inverse:
            pairs = (zip(plan.bit_labels(a), plan.inverse_labels(a), strict=True) for a in AXES)
            groups += [list(pair) for axis in pairs for pair in axis]
        means = (self.light[[image_index[label] for label in group]].mean(0) for group in groups)
        return all(float(np.median(np.abs(mean))) <= 2 * BALANCE for mean in means)

    def fine_bits_vary(self, plan: StackPlan, image_index: dict[str, int]) -> bool:
        """Tell whether the finest bits vary.

        Else a white image passes for one, where only half of the pattern is seen.
        """
        finest = [label for axis in AXES for label in plan.bit_labels(axis)[-FINEST:]]
        bright = (self.light[[image_index[label] for label in finest]] > 0).mean(1)
        return bool((np.minimum(bright, 1 - bright) >= CONSTANT).all())

    def axis(self, plan: StackPlan, axis: Axis, image_index: dict[str, int]) -> AxisImages:
        """Return the images of an axis, of a plan whose labels lie at these places."""
        labels = labels_needed(plan, axis)
        return axis_images({label: self.images[image_index[label]] for label in labels}, plan, axis)


def take_samples(stack: StackSource, noise: float, need: float) -> StackSamples:
    """Return the tiles with most contrast of all images."""
    height, width = stack.shape
    side_y, side_x = min(TILE, height), min(TILE, width)
    rows, columns = (
        np.linspace(0, extent - side, min(6, -(-extent // side))).astype(int).tolist()
        for extent, side in ((height, side_y), (width, side_x))
    )
    spans = [(top, top + side_y) for top in rows]
    by_image = [
        [
            band.images[0, ::STRIDE, left : left + side_x : STRIDE]
            for band in bands
            for left in columns
        ]
        for bands in stack.windows(spans)
    ]
    tiles = [np.stack(tile) for tile in zip(*by_image, strict=True)]
    contrast = [np.ptp(tile, axis=0) for tile in tiles]
    bright = sorted(range(len(tiles)), key=lambda k: -float(np.median(contrast[k])))[:TILES]
    images = np.stack([tiles[k] for k in bright], 1)
    lit = np.stack([contrast[k] for k in bright]) >= need
    return StackSamples(images, noise, lit)
