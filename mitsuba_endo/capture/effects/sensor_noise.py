"""Noise of the sensor: counting of photo-electrons, and reading them out."""

import numpy as np
from numpy.typing import NDArray

_MANY = 200.0
"""Electrons beyond which a Poisson variable is drawn as Gaussian (skewness below 0.07)."""


def sensor_noise(
    signal: NDArray[np.float32], full_well: float, read_noise: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return the signal with shot and read noise.

    A pixel of mean signal s has variance s / full_well + (read_noise / full_well)^2: the photon
    transfer line. Clipping at full well comes before read-out.

    Args:
        signal: (h, w, c) share of full scale, from 0.
        full_well: electrons at full scale.
        read_noise: standard deviation, electrons.
        rng: of this stage alone.
    """
    mean = np.clip(signal, 0, None) * np.float32(full_well)
    normal = rng.standard_normal(mean.shape, np.float32)
    electrons = mean + np.sqrt(mean) * normal
    few = mean < _MANY
    electrons[few] = rng.poisson(mean[few])
    electrons = np.minimum(electrons, np.float32(full_well))
    if read_noise:
        electrons += np.float32(read_noise) * rng.standard_normal(mean.shape, np.float32)
    return (electrons / np.float32(full_well)).astype(np.float32, copy=False)
