"""Robust losses against finite differences and their defining properties."""

import numpy as np
import pytest

from mitsuba_endo.solve.costs.noise_scale import NoiseScale
from mitsuba_endo.solve.costs.robust_loss import LOSSES


@pytest.mark.parametrize("name", LOSSES)
@pytest.mark.parametrize("c", [0.4, 3.0])
class TestLoss:
    def test_weight_is_the_derivative_of_the_loss(self, name: str, c: float):
        """Oracle: central differences of the loss with respect to r^2 / 2."""
        loss = LOSSES[name]
        r2 = np.array([0.0, 0.01, 0.3, 0.9, 2.0, 30.0]) * c * c + 1e-3
        h = 1e-5 * c * c
        numeric = (loss(r2 + h, c) - loss(r2 - h, c)) / h
        np.testing.assert_allclose(loss.weight(r2, c), numeric, rtol=1e-6, atol=1e-9)

    def test_small_residuals_are_squared(self, name: str, c: float):
        """Oracle: r^2 / 2, weight one."""
        loss, r2 = LOSSES[name], np.array([1e-4 * c * c])
        np.testing.assert_allclose(loss(r2, c), r2 / 2, rtol=2e-4)
        np.testing.assert_allclose(loss.weight(r2, c), 1, rtol=3e-4)

    def test_gross_errors(self, name: str, c: float):
        """Oracle: influence w r falls; to nothing where the loss is redescending, Tukey's."""
        loss = LOSSES[name]
        r = np.array([3.0, 30.0]) * c
        influence = loss.weight(r * r, c) * r
        assert influence[1] < influence[0] or influence[0] == 0
        assert (influence[1] == 0) == (name == "tukey")

    def test_efficient_scale(self, name: str, c: float):
        """Oracle: asymptotic efficiency (Huber), b^2 / a of two Gaussian components, by sampling.

        a = E|w r|^2 / 2 and b is the mean derivative of w r.
        """
        loss = LOSSES[name]
        scale = loss.efficient_scale * c
        r = np.random.default_rng(0).normal(0, c, (2, 400_000))
        r2 = (r * r).sum(0)
        h = 1e-4 * c * c
        slope = (loss.weight(r2 + h, scale) - loss.weight(r2, scale)) / h
        a = np.mean((loss.weight(r2, scale) * r) ** 2) / c**2
        b = np.mean(loss.weight(r2, scale) + slope * r2)
        assert 0.945 < b * b / a < 1


@pytest.mark.parametrize("name", LOSSES)
def test_scale_goes_with_the_loss_of_the_stage(name: str) -> None:
    """Oracle: efficient scales of Cauchy in the first stage, of the named loss in the last one."""
    first = NoiseScale(0.4, name)
    assert first.loss is LOSSES["cauchy"]
    assert first.scale == pytest.approx(0.4 * 3.5)
    last = first.final(0.3)
    assert last.loss is LOSSES[name]
    assert last.scale == pytest.approx(0.3 * LOSSES[name].efficient_scale)
    assert last.at(0.1).scale == pytest.approx(0.1 * LOSSES[name].efficient_scale)
    assert last.at(0.1).last


def test_infinite_noise_is_where_a_minimiser_begins() -> None:
    """Oracle: the first estimate, whatever it is."""
    assert NoiseScale(float("inf"), "tukey").followed(7.0).sigma == 7.0
