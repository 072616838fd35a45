"""The projected pattern as an image that can be blurred, differentiated and looked up."""

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..decoding.grid_pattern import CodedGrid
from ..decoding.image_files import full_scale, read_image
from ..decoding.normalise import one_channel
from ..errors import InputError
from .cells import Image

TEXELS = 4
"""Texels per pattern pixel of a pattern given by a formula: linear interpolation of its thinnest
lines is then right to 1 %."""
LEVEL = 0.1
"""Blurs are rounded to multiples of that, pattern pixels, because making one takes as long as using
it."""
KEPT = 6
"""Blurred patterns kept."""


class PatternImage:
    """Brightness of a pattern, and its derivatives, at any blur."""

    def __init__(self, texture: Image, width: int, height: int) -> None:
        """Keep the pattern.

        Args:
            texture: (h, w) linear brightness over the whole pattern, at least a texel per pixel.
            width: of the pattern, pattern pixels.
            height: of the pattern.
        """
        self.texture = np.ascontiguousarray(texture, np.float32)
        self.width, self.height = width, height
        self._scale = np.array([texture.shape[1] / width, texture.shape[0] / height], np.float32)
        self._blurred = lru_cache(KEPT)(self._make)
        self._bent = lru_cache(KEPT)(self._make_laplacian)

    @classmethod
    def of_grid(cls, grid: CodedGrid) -> "PatternImage":
        """Return the coded grid's pattern."""
        size = grid.width * TEXELS, grid.height * TEXELS
        return cls(grid.texture(*size), grid.width, grid.height)

    def holds(self, q: Image) -> NDArray[np.bool_]:
        """Tell which coordinates (..., 2) lie on the pattern."""
        size = np.array([self.width, self.height])
        return np.asarray(((q >= -0.5) & (q <= size - 0.5)).all(-1))

    def look_up(self, q: Image, blur: float) -> tuple[Image, Image, Image]:
        """Return brightness and its derivatives along x and y, (H, W) each.

        Args:
            q: (H, W, 2) pattern pixels, finite; beyond the pattern its border goes on.
            blur: standard deviation of the blur, pattern pixels.
        """
        planes = cv2.split(self._at(q, self._blurred(_level(blur))[0]))
        value, x, y = (np.asarray(plane, np.float32) for plane in planes)
        return value, x, y

    def brightness(self, q: Image, blur: float) -> Image:
        """Return brightness (H, W); arguments as for :meth:`look_up`."""
        return self._at(q, self._blurred(_level(blur))[1])

    def laplacian(self, q: Image, blur: float) -> Image:
        """Return the Laplacian (H, W); arguments as for :meth:`look_up`."""
        return self._at(q, self._bent(_level(blur)))

    def _at(self, q: Image, texture: Image) -> Image:
        at = (q + np.float32(0.5)) * self._scale - np.float32(0.5)
        border = cv2.BORDER_REPLICATE
        return np.asarray(cv2.remap(texture, at.astype(np.float32), None, cv2.INTER_LINEAR,  # pyright: ignore[reportCallIssue, reportArgumentType]
                                    borderMode=border))  # fmt: skip

    def _make(self, level: int) -> tuple[Image, Image]:
        """Return brightness with its derivatives (h, w, 3), and brightness alone."""
        sigma = level * LEVEL * self._scale
        value = self.texture
        if level:
            value = cv2.GaussianBlur(value, (0, 0), float(sigma[0]), sigmaY=float(sigma[1]),
                                     borderType=cv2.BORDER_REPLICATE)  # fmt: skip
        value = np.asarray(value, np.float32)
        planes = [value, *(_derivative(value, axis, self._scale[axis]) for axis in (0, 1))]
        return np.asarray(cv2.merge(planes), np.float32), value

    def _make_laplacian(self, level: int) -> Image:
        gradient = self._blurred(level)[0][..., 1:]
        x, y = (_derivative(gradient[..., k], k, self._scale[k]) for k in (0, 1))
        return x + y


def _level(blur: float) -> int:
    return round(blur / LEVEL)


def _derivative(image: Image, axis: int, scale: np.float32) -> Image:
    """Return the central differences of an image along x (0) or y, times ``scale``.

    As ``np.gradient``, in a tenth of its time; at the border half the one-sided difference.
    """
    kernel = np.array([[-0.5, 0.0, 0.5]], np.float32) * scale
    one = np.ones((1, 1), np.float32)
    row, column = (kernel, one) if axis == 0 else (one, kernel)
    border = cv2.BORDER_REPLICATE
    differences = cv2.sepFilter2D(np.ascontiguousarray(image), -1, row, column, borderType=border)
    return np.asarray(differences, np.float32)


@lru_cache(4)
def grid_image(grid: CodedGrid) -> PatternImage:
    """Return a coded grid's pattern, made once."""
    return PatternImage.of_grid(grid)


def load_pattern(path: Path, width: int, height: int, gamma: float = 1.0) -> PatternImage:
    """Read a pattern that is known as an image, one pixel of the image a pattern pixel.

    Args:
        path: of the image.
        width: the projector's, pattern pixels.
        height: the projector's.
        gamma: the image holds brightness^(1 / gamma).

    Raises:
        InputError: no image, of another size, or without any structure.
    """
    raw = read_image(path)
    gray: NDArray[np.float32] = one_channel((raw / full_scale(raw)).astype(np.float32))
    if gray.shape != (height, width):
        raise InputError(
            f"is {gray.shape[1]} x {gray.shape[0]} pixels and the rig's projector.width x "
            f"projector.height {width} x {height}",
            str(path), "give the pattern as it is projected",
        )  # fmt: skip
    if gray.max() == gray.min():
        raise InputError("is one even colour", str(path), "give the pattern that is projected")
    return PatternImage(np.clip(gray, 0, 1) ** np.float32(gamma), width, height)
