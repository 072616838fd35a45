"""What would be left of smooth errors: pull of scattered light, and fine errors of the start."""

import numpy as np
from scipy.ndimage import gaussian_filter

from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.refine import growth, refine_map
from mitsuba_endo.refine.cells import Links
from mitsuba_endo.refine.pattern_image import grid_image
from mitsuba_endo.refine.smoother import Smoother
from mitsuba_endo.refine.start_smoothing import smoothed_start
from mitsuba_endo.refine.windows import Windows
from tests.refine.views import GRID, HEIGHT, PERIOD, WIDTH, coordinates, rms

PATTERN = grid_image(GRID)
SPREAD_PX = 1.2
"""Blur of the light that has fallen in, camera pixels: 1.6 pattern pixels."""


def _photo(truth: np.ndarray) -> np.ndarray:
    """Return an image under light that grows by a factor e over 40 pixels, then is scattered."""
    x = np.arange(WIDTH)[None]
    light = np.exp(np.minimum(x, WIDTH - x) / 40) * GRID.brightness(truth)
    light = gaussian_filter(light, SPREAD_PX)
    return np.rint(65535 * np.clip(light / light.max(), 0, 1) ** (1 / 2.2)).astype(np.uint16)


def _slant(truth: np.ndarray, q: np.ndarray) -> float:
    """Return the error along u of rising light minus that of falling, half, pattern pixels."""
    x = np.arange(WIDTH)
    error = (q - truth)[10:-10, :, 0]
    rising, falling = (x > 20) & (x < 80), (x > 120) & (x < WIDTH - 20)
    return float(error[:, rising].mean() - error[:, falling].mean()) / 2


def test_the_pull_of_scattered_light_is_taken_away(monkeypatch):
    """Oracle: s grad log a with s the blur's variance: 1.56^2 pattern px^2, and 1 / (40 px 1.3) per
    pattern px, 0.047 px. Of it less than a third is left."""
    truth = coordinates()
    start = CorrespondenceMap(truth.astype(np.float32), "frame")
    corrected = refine_map.refine_map(start, _photo(truth), PATTERN).map.q
    for module in (refine_map, growth):
        monkeypatch.setattr(module, "without_pull", lambda frame, refined: refined.q)
    plain = refine_map.refine_map(start, _photo(truth), PATTERN).map.q
    expected = (1.3 * SPREAD_PX) ** 2 / (40 * 1.3)
    assert abs(_slant(truth, plain) / expected - 1) < 0.3
    assert abs(_slant(truth, corrected)) < 0.33 * expected


def _smooth(q: np.ndarray, narrow: float = 6.0, broad: float = 12.0) -> tuple[np.ndarray, ...]:
    """Return a map (H, W, 2) smoothed as starts are, and under narrow or broad windows alone."""
    h, w = q.shape[0] // 3, q.shape[1] // 3
    links = Links(np.ones((h, w - 1), bool), np.ones((h - 1, w), bool))
    weight, windows = np.ones(q.shape[:2], np.float32), Windows(links, narrow)
    wide = Smoother(Windows(links, broad), links, weight)
    q = q.astype(np.float32)
    return (smoothed_start(q, weight, links, windows, wide),
            Smoother(windows, links, weight).pixels(q), wide.pixels(q))  # fmt: skip


def test_errors_that_recur_once_a_period_are_smoothed_away():
    """Oracle: the exact coordinates; narrow windows let a third as much more through."""
    truth = coordinates()[:, : WIDTH // 3 * 3]
    wrong = truth + 0.15 * np.sin(2 * np.pi * truth / PERIOD) + 0.2 * gaussian_filter(
        np.random.default_rng(1).standard_normal(truth.shape), (3, 3, 0)) / 0.1  # fmt: skip
    both, narrow, _ = _smooth(wrong)
    assert rms(both, truth) < 0.75 * rms(narrow, truth)


def test_where_the_surface_bends_the_narrow_windows_count():
    """Oracle: a ridge of 24 pixels, which broad windows alone flatten by 0.8 pixels."""
    truth = coordinates()[:, : WIDTH // 3 * 3].copy()
    x = np.arange(truth.shape[1])
    truth[..., 0] += 6 * np.exp(-0.5 * ((x - 100) / 10) ** 2)
    both, narrow, broad = _smooth(truth)
    ridge = (slice(20, HEIGHT - 20), slice(92, 109))
    assert np.abs(both - narrow)[ridge].max() < 0.15
    errors = [rms(q[ridge], truth[ridge], 1) for q in (narrow, both, broad)]
    assert errors[1] < 1.6 * errors[0]
    assert errors[1] < 0.3 * errors[2]
