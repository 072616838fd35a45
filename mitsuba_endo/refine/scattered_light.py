"""Light that spreads after it has fallen in, which pulls lines towards the brighter side.

Tissue and lens blur the light that is there, pattern times illumination, not the pattern alone.
With a blur of variance s, K * (a T) is a (K * T) + s grad a . grad (K * T) to first order, that is
a times the blurred pattern at q + s grad log a, gradients along the pattern's axes. So coordinates
found on a pattern that is blurred alone are off by s grad log a, and both are known: s is the blur
that fits the image, a the regression's gain.
"""

import numpy as np

from .cells import Image, blend, repeated
from .iterate import CORE, Comparison, Refined

STEEPEST = 0.3
"""Largest change of the gain's logarithm over a pattern pixel that is believed: a factor of 36 over
the coded grid's period."""
SINGULAR = 1e-3
"""Least determinant of the coordinates' derivative by camera pixels."""
HELD = 0.5
"""Sum of weights, in cells, that a window must hold to have gradients."""


def without_pull(frame: Comparison, refined: Refined) -> Image:
    """Return refined coordinates (H, W, 2) without what scattered light pulls them by."""
    variance = (refined.blur / CORE) ** 2
    pull = variance * _gradient_of_gain(frame, refined)
    return refined.q - blend(pull.astype(np.float32), frame.links)


def _gradient_of_gain(frame: Comparison, refined: Refined) -> Image:
    """Return the gradient (h, w, 2) of the gain's logarithm per pattern pixel."""
    shape, smoother = frame.windows.shape, frame.smoother
    gain = np.log(refined.fit.gain).astype(np.float32).reshape(shape)
    by_pixel = smoother.fit(repeated(gain))[1]
    (a, b), (c, d) = (np.moveaxis(smoother.fit(refined.q[..., k])[1], -1, 0) for k in (0, 1))
    det = a * d - b * c
    # grad_q = J^-T grad_pixel, for J = [[a, b], [c, d]] = dq / dpixel.
    usable = (np.abs(det) > SINGULAR) & (smoother.support.reshape(shape) > HELD)
    scale = np.where(usable, 1 / np.where(usable, det, 1), 0)
    x, y = by_pixel[..., 0], by_pixel[..., 1]
    along = np.stack([d * x - c * y, a * y - b * x], -1) * scale[..., None]
    return np.clip(along, -STEEPEST, STEEPEST)
