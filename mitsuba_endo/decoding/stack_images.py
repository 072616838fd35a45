"""The images of a stack, in memory or wherever they come from, and their noise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from ..robust import robust_std

NOISE_IMAGES = 8
"""Of the stack, evenly drawn, from which the noise is estimated."""
NOISE_PIXELS = 1 << 22
"""Of such an image: of larger ones the middle rows."""


@dataclass(frozen=True, eq=False)
class Stack:
    """Images of one stack, in memory."""

    images: NDArray[np.float32]
    """(N, H, W) linear brightness from 0 to 1 = full scale."""
    saturated: NDArray[np.bool_]
    """(N, H, W) pixels of which a channel is at full scale."""
    levels: int
    """Grey levels of full scale: the images are quantised to them."""

    def __len__(self) -> int:
        return len(self.images)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the images."""
        return self.images.shape[1], self.images.shape[2]

    def rows(self, which: Sequence[int], start: int, stop: int) -> "Stack":
        """Return rows ``start`` to ``stop`` of some images."""
        rows = (list(which), slice(start, stop))
        return Stack(self.images[rows], self.saturated[rows], self.levels)

    def windows(self, spans: Sequence[tuple[int, int]]) -> Iterator[list["Stack"]]:
        """Yield each image's rows in several spans."""
        for k in range(len(self)):
            yield [self.rows([k], start, stop) for start, stop in spans]


class StackSource(Protocol):
    """Whatever gives images of a stack by rows: a :class:`Stack`, or files."""

    def __len__(self) -> int: ...

    @property
    def levels(self) -> int: ...

    @property
    def shape(self) -> tuple[int, int]: ...

    def rows(self, which: Sequence[int], start: int, stop: int) -> Stack: ...

    def windows(self, spans: Sequence[tuple[int, int]]) -> Iterator[list[Stack]]: ...


def estimate_noise(stack: StackSource) -> float:
    """Return the standard deviation of the brightness, of full scale.

    From the product of second differences along both axes, which removes whatever depends on one
    axis alone and smooth shading (J. Immerkaer, "Fast noise variance estimation", 1996); its median
    leaves edges out. Never less than the rounding to whole grey levels.
    """
    kernel = np.outer([1, -2, 1], [1, -2, 1]).astype(np.float32)
    chosen = np.unique(np.linspace(0, len(stack) - 1, NOISE_IMAGES).astype(int)).tolist()
    height, width = stack.shape
    rows = min(height, max(3, NOISE_PIXELS // width))
    start = (height - rows) // 2
    spreads = []
    for image in chosen:
        brightness = stack.rows([image], start, start + rows).images[0]
        spreads.append(robust_std(cv2.filter2D(brightness, -1, kernel)) / np.linalg.norm(kernel))
    return max(float(np.median(spreads)), 1 / (stack.levels * np.sqrt(12)))
