"""Brown's distortion at its extremes."""

import numpy as np
import pytest

from mitsuba_endo.geometry.brown_distortion import BrownDistortion


@pytest.mark.parametrize(
    "coefficients", [(-0.4, 0.15, 0.002, -0.003, 0.0), (0.9, 0.4), (-0.3, 0.0, 0.01)]
)
def test_strong_distortion_is_removed_exactly(coefficients: tuple[float, ...]) -> None:
    """Oracle: the identity, on points whose field of view is 85 degrees."""
    brown = BrownDistortion(coefficients)
    grid = np.stack(np.meshgrid(np.linspace(-0.75, 0.7, 23), np.linspace(-0.5, 0.55, 17)), -1)
    x, y = grid[..., 0], grid[..., 1]
    back = brown.remove(*brown.apply(x, y))
    np.testing.assert_allclose(np.stack(back, -1), grid, atol=1e-12)


def test_jacobian() -> None:
    """Oracle: central differences of ``apply`` with all eight terms."""
    brown = BrownDistortion((0.4, 0.03, 1.5e-3, -2e-3, 0.002, 0.7, 0.1, 0.01))
    x, y = np.random.default_rng(0).uniform(-0.8, 0.8, (2, 50))
    step = 1e-6
    dx = (np.array(brown.apply(x + step, y)) - np.array(brown.apply(x - step, y))) / (2 * step)
    dy = (np.array(brown.apply(x, y + step)) - np.array(brown.apply(x, y - step))) / (2 * step)
    np.testing.assert_allclose(brown.jacobian(x, y), [dx[0], dx[1], dy[1]], atol=1e-8)
    np.testing.assert_allclose(dx[1], dy[0], atol=1e-8)
