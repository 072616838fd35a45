"""Light in a scattering half-space: how much comes back, and how far from where it entered."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls, root_scalar

VARIANCES = 0.04 * 6.0 ** np.arange(5)
"""Variances (per axis) of the Gaussians that make up a profile, in mean free paths squared."""


def internal_reflection(index: float) -> float:
    """Return the share of diffuse light that the boundary reflects back inside.

    Source: Egan and Hilgeman's fit, as used by Jensen et al. 2001 (equation after 4).
    """
    return -1.440 / index**2 + 0.710 / index + 0.668 + 0.0636 * index


def diffuse_reflectance(albedo: float, index: float) -> float:
    """Return the share of light that comes back out of a half-space, isotropic scattering.

    Source: Flock et al. 1989, diffusion theory for diffuse light: with k = (1 + r) / (1 - r),
    R = a / (1 + 2 k (1 - a) + (1 + 2 k / 3) sqrt(3 (1 - a))).
    """
    r = internal_reflection(index)
    k = (1 + r) / (1 - r)
    rest = 1 - albedo
    return albedo / (1 + 2 * k * rest + (1 + 2 * k / 3) * np.sqrt(3 * rest))


def scattering_albedo(reflectance: float, index: float) -> float:
    """Return the single-scattering albedo of a half-space that sends back ``reflectance``."""
    if reflectance >= 1:
        return 1.0
    root = root_scalar(lambda a: diffuse_reflectance(a, index) - reflectance, bracket=(0, 1))
    return float(root.root)


@lru_cache(maxsize=256)
def profile_weights(reflectance: float, index: float) -> NDArray[np.float64]:
    """Return the weights, of sum 1, of Gaussians with :data:`VARIANCES` for a half-space.

    They are fitted to the Hankel transform of the light's spread. Between two meetings with the
    boundary that is the normalised diffusion profile of Christensen and Burley 2015 (equations 3
    and 6); the boundary returns the share r, which then spreads again, so that the transform of
    all that comes out is that of a geometric series.
    """
    r = internal_reflection(index)
    # Reflectance without a boundary: R = (1 - r) R0 / (1 - r R0).
    bare = reflectance / (1 - r + r * reflectance)
    s = 1.9 - bare + 3.5 * (bare - 0.8) ** 2
    k = np.concatenate([[0.0], np.geomspace(0.02, 20, 200)])
    once = s / 4 * (1 / np.hypot(k, s) + 1 / np.hypot(k, s / 3))
    spread = (1 - r * bare) * once / (1 - r * bare * once)
    gaussians = np.exp(-0.5 * k[:, None] ** 2 * VARIANCES)
    weights = nnls(gaussians, spread)[0]
    return weights / weights.sum()
