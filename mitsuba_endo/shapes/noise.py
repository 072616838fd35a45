"""Smooth random fields: sums of plane waves, which are infinitely differentiable."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def random_waves(points: Array, wavelength: float, rng: np.random.Generator) -> Array:
    """Return an isotropic field of zero mean and unit variance at points (..., D), mm.

    Wave lengths spread by a fifth around `wavelength` (mm); directions are uniform.
    """
    count, dimension = 32, points.shape[-1]
    direction = rng.normal(size=(count, dimension))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return _sum_of_waves(points, direction, wavelength, rng)


def ridge_waves(
    points: Array, wavelength: float, orientation: float, spread: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return a field of unit variance at points (..., 2) that forms long ridges, and its slope.

    The slope (...) is the length of the field's gradient, 1/mm.

    Waves travel within about `spread` (rad, standard deviation) of the direction across the
    ridges; their interference bends, forks and ends the ridges as real folds do.

    Args:
        points: positions, mm.
        wavelength: mean distance of neighbouring ridges, mm.
        orientation: angle of the ridges from the first axis, rad.
        spread: 0 gives straight ridges.
        rng: source of directions and phases.
    """
    angle = orientation + np.pi / 2 + spread * rng.normal(size=32)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    gradient = np.zeros(points.shape)
    field = _sum_of_waves(points, direction, wavelength, rng, gradient)
    return field, np.linalg.norm(gradient, axis=-1)


def _sum_of_waves(
    points: Array, direction: Array, wavelength: float, rng: np.random.Generator,
    gradient: Array | None = None,
) -> Array:  # fmt: skip
    """Return the field (...) for unit `direction` (N, D) of the waves.

    Its gradient is added to `gradient` (..., D), if given: it costs three times the field.
    """
    count = len(direction)
    number = 2 * np.pi / (wavelength * rng.uniform(0.8, 1.2, count))
    phase = rng.uniform(0, 2 * np.pi, count)
    total, scale = np.zeros(points.shape[:-1]), np.sqrt(2 / count)
    for wave, offset in zip(number[:, None] * direction, phase, strict=True):
        angle = points @ wave + offset
        total += np.cos(angle)
        if gradient is not None:
            gradient -= np.sin(angle)[..., None] * (scale * wave)
    return total * scale
