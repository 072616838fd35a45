"""Laser speckle."""

import functools

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, ndtr

_TABLE = np.linspace(-5.5, 5.5, 1101)
"""Values of the Gaussian field at which the intensity is tabulated."""


def speckle(
    shape: tuple[int, int], contrast: float, grain: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return a speckle field (h, w) of mean 1 to multiply laser light by.

    Intensity follows the gamma distribution with 1 / contrast^2 degrees of freedom, that of
    partially developed speckle, the sum of so many independent patterns (Goodman, Speckle
    Phenomena in Optics, section 4.2); contrast 1 gives the exponential law. A Gaussian field is
    filtered to the wanted autocovariance and its values mapped to that distribution.

    Args:
        shape: (h, w).
        contrast: standard deviation over mean, 0 to 1.
        grain: full width at half maximum of the intensity's autocovariance, pixels.
        rng: of this stage alone.
    """
    if contrast == 0:
        return np.ones(shape, np.float32)
    intensity, half = _gamma_table(contrast)
    field = _gaussian_field(shape, _kernel(grain, half), rng)
    step = np.float32(_TABLE[1] - _TABLE[0])
    entry = np.clip((field - np.float32(_TABLE[0])) / step, 0, np.float32(len(_TABLE) - 1.001))
    index = entry.astype(np.int32)
    low = intensity[index]
    field = low + (entry - index.astype(np.float32)) * (intensity[index + 1] - low)
    return np.asarray(field, np.float32)


def _gaussian_field(
    shape: tuple[int, int], kernel: NDArray[np.float32], rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return white noise filtered by ``kernel`` along both axes."""
    margin = len(kernel) // 2
    h, w = shape
    white = rng.standard_normal((h + 2 * margin, w + 2 * margin), np.float32)
    smooth = cv2.sepFilter2D(white, -1, kernel, kernel)
    return np.asarray(smooth[margin : margin + h, margin : margin + w], np.float32)


@functools.lru_cache(maxsize=64)
def _kernel(grain: float, half: float) -> NDArray[np.float32]:
    """Return the kernel that gives white noise unit variance and a Gaussian autocovariance.

    The autocovariance is ``half`` at the distance grain / 2, also for grains of a pixel or two,
    which a sampled Gaussian kernel would make too small: the kernel's transform is the root of
    the autocovariance's.
    """
    reach = int(np.ceil(2.5 * grain)) + 8
    distance = np.arange(-reach, reach + 1)
    covariance = half ** ((2 * distance / grain) ** 2)
    power = np.fft.fft(np.fft.ifftshift(covariance)).real
    kernel = np.fft.fftshift(np.fft.ifft(np.sqrt(np.maximum(power, 0))).real)
    return (kernel / np.linalg.norm(kernel)).astype(np.float32)


@functools.lru_cache(maxsize=64)
def _gamma_table(contrast: float) -> tuple[NDArray[np.float32], float]:
    """Return intensity at :data:`_TABLE`, and the Gaussian correlation that halves covariance."""
    dof = 1 / contrast**2
    intensity = gammaincinv(dof, ndtr(_TABLE)) / dof
    return intensity.astype(np.float32), _halving_correlation(intensity)


def _halving_correlation(f: NDArray[np.float64]) -> float:
    """Return the correlation of the Gaussian field at which that of the intensity is 1/2.

    Mehler's formula: the covariance of f(x), f(y) is the sum of a_k^2 rho^k with a_k the
    coefficients of f in normalised Hermite polynomials.
    """
    x, weight = _TABLE, np.exp(-0.5 * _TABLE**2)
    weight = weight / weight.sum()
    power, previous, current = [], np.ones_like(x), x
    for k in range(1, 25):
        power.append(float((weight * f * current).sum()) ** 2)
        previous, current = current, (x * current - np.sqrt(k) * previous) / np.sqrt(k + 1)
    series = np.array(power)
    rho = np.linspace(0, 1, 2001)
    covariance = (series[:, None] * rho ** np.arange(1, 25)[:, None]).sum(0) / series.sum()
    return float(np.interp(0.5, covariance, rho))
