"""How well refined coordinates are known: covariances from the regression and its residual."""

import cv2
import numpy as np

from .cells import SIDE, Image, mean
from .iterate import DARK, ROBUST, Comparison, Refined, relative_residual

LAG = 2
"""Camera pixels up to which residuals go together: grains of speckle, the lens's blur."""
LARGEST = 1e4
"""Pattern pixels squared: as good as nothing known."""
REFERENCE = 0.1**2
"""Variance, pattern pixels squared, at which a coordinate's variance is GROWTH times the linear
one."""
GROWTH = 4.5
"""Beside noise in one window: noise that smoothing brings from others, and errors of the start that
are finer than a window."""
POWER = 0.4
"""By which that grows with the variance: noise that moves coordinates by a part of a line's width
does so more than linearly. Measured, with GROWTH, on 30 photographs of five kinds of scenes with
speckle of contrast 0 to 0.8, and again on 10 when starts were smoothed as they are now."""
LEFT = 0.05
"""Share of a correction that is left to do: a start's errors narrower than two windows."""
FLOOR = 0.015
"""Standard deviation of what is finer than any window, pattern pixels."""


def cell_covariance(frame: Comparison, refined: Refined) -> Image:
    """Return the covariance (h, w, 3) of u and v, xx, xy, yy, in pattern pixels squared.

    A sandwich: under each window the inverse of the normal matrix times its mean squared residual,
    and for the whole image by how much the scores (residual times derivative) of robustly weighted,
    neighbouring pixels scatter more than that. A Gaussian window's squared weights sum to half
    of its weights.
    """
    fit, shape = refined.fit, frame.windows.shape
    used = frame.windows.moments([mean(frame.usable)]).of(0, 0)
    noise = fit.residual / np.maximum(used, 1e-6)
    uu, uv, vv = fit.information.T
    det = np.maximum(uu * vv - uv * uv, 1e-30)
    unit = 0.5 * noise / (SIDE**2 * det)
    u, v = (_excess(frame, refined, d) for d in refined.derivatives)
    linear = np.stack([u * unit * vv, -np.sqrt(u * v) * unit * uv, v * unit * uu], -1)
    size = np.sqrt(linear[:, 0] * linear[:, 2])
    covariance = linear * (GROWTH * (size / REFERENCE) ** POWER)[:, None]
    moved = np.mean(refined.moved.reshape(-1, 2) ** 2, 1)
    covariance[:, [0, 2]] += (LEFT**2 * moved + FLOOR**2)[:, None]
    return np.clip(covariance, -LARGEST, LARGEST).reshape(*shape, 3).astype(np.float32)


def _excess(frame: Comparison, refined: Refined, derivative: Image) -> float:
    """Return the variance of displacements along one axis over that of independent residuals."""
    base = frame.usable / (DARK + np.maximum(refined.predicted, 0)) ** 2
    z = relative_residual(frame, refined.predicted) / np.float32(ROBUST * refined.scale)
    z *= frame.usable
    weight = 1 / (1 + z * z)
    slope = np.sqrt(base) * derivative
    score = z * weight * slope
    side = 2 * LAG + 1
    around = cv2.boxFilter(score, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
    power = float(np.mean(score * around))
    sharp = float(np.mean((1 - z * z) * weight**2 * slope**2))
    plain = float(np.mean(weight * slope**2))
    error = float(np.sum(weight * z * z) / max(float(frame.usable.sum()), 1))
    if sharp <= 0 or error == 0:
        return 1.0
    return max(power * plain / (sharp**2 * error), 1e-3)
