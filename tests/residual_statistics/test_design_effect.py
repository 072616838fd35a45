"""Design effects against closed forms and Monte Carlo."""

import numpy as np
import pytest

from mitsuba_endo.residual_statistics.design_effect import design_effect
from tests.residual_statistics.noise import SHAPE, ar_design_effect, autoregressive, holes, white

DRAWS = 60


def _mean(draws: list[np.ndarray], weights: np.ndarray | None = None) -> np.ndarray:
    """Return lengths, mean values and their standard errors over draws and components, (3, K)."""
    found = [design_effect(r, weights) for r in draws]
    values = np.concatenate([f.values for f in found], 1)
    error = values.std(1) / np.sqrt(values.shape[1])
    return np.stack([found[0].lengths, values.mean(1), error])


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("weighted", [False, True])
def test_white_noise_has_none(masked: bool, weighted: bool):
    """Oracle: 1 at all lengths, within four standard errors of Monte Carlo; noise in half of the
    image three times as strong."""
    rng = np.random.default_rng(1)
    mask = holes(rng) if masked else np.ones(SHAPE, bool)
    weights = rng.uniform(0.2, 1, SHAPE) if weighted else None
    uneven = np.where(np.arange(SHAPE[1]) < 66, 1.0, 3.0)[None, :, None]
    draws = [np.where(mask[..., None], uneven * white(rng), np.nan) for _ in range(DRAWS)]
    lengths, values, errors = _mean(draws, weights)
    assert lengths.tolist() == [4, 8, 16, 32, 64, 128, 132]
    # Cutting far blocks off at five deviations takes some of the strong half's variance.
    assert (np.abs(values - 1) < 4 * errors + 0.02).all(), (values, errors)


def test_white_noise_is_not_called_correlated():
    """Oracle: seven lengths, two components and one in a thousand: at most 1.4 % of draws."""
    rng = np.random.default_rng(2)
    wide = [design_effect(white(rng)).largest > 1 for _ in range(300)]
    assert np.mean(wide) <= 0.03


@pytest.mark.parametrize("rho", [0.5, 0.8])
def test_correlated_noise(rho: float):
    """Oracle: the closed form of separable AR(1) noise at every length, within Monte Carlo."""
    rng = np.random.default_rng(3)
    lengths, values, errors = _mean([autoregressive(rng, rho) for _ in range(DRAWS)])
    square = lengths <= min(SHAPE)
    expected = np.array([ar_design_effect(rho, int(n)) for n in lengths[square]])
    assert (np.abs(values[square] - expected) < 4 * errors[square] + 0.02 * expected).all()


def test_correlated_noise_seen_here_and_there():
    """Oracle: of pixels seen with probability p each meets p times as many like itself."""
    rng = np.random.default_rng(4)
    draws = [
        np.where((rng.random(SHAPE) < 0.3)[..., None], autoregressive(rng, 0.8), np.nan)
        for _ in range(DRAWS)
    ]
    lengths, values, errors = _mean(draws)
    square = (lengths <= min(SHAPE)) & (lengths >= 8)
    expected = np.array([1 + 0.3 * (ar_design_effect(0.8, int(n)) - 1) for n in lengths[square]])
    assert (np.abs(values[square] - expected) < 4 * errors[square] + 0.03 * expected).all()


def test_smooth_bias_grows_with_the_block():
    """Oracle: a bias that is alike over a block adds its share of the energy times its pixels."""
    rng = np.random.default_rng(5)
    x = np.arange(SHAPE[1])
    bias = 0.3 * np.sqrt(2) * np.sin(2 * np.pi * x / 132)[None, :, None]
    found = design_effect(bias + white(rng))
    share = 0.09 / 1.09
    for k, length in enumerate((4, 8, 16)):
        assert found.values[k] == pytest.approx(1 + share * length**2, rel=0.25)
    assert found.largest > 100


def test_one_patch_of_slips_does_not_stand_for_the_image():
    """Oracle: 12 x 12 pixels off by ten deviations, 1 % of the image, weigh little."""
    r = white(np.random.default_rng(6), (120, 160))
    patch = r.copy()
    patch[40:52, 60:72] += 10
    plain = (patch[:, :, 0] ** 2).mean() * 144  # if the mean square counted
    found = design_effect(patch)
    assert found.values[:3].max() < 3
    assert plain > 100


def test_nothing_seen():
    """Oracle: the contract."""
    found = design_effect(np.full((20, 30, 2), np.nan))
    assert (len(found.lengths), found.largest) == (0, 1.0)
