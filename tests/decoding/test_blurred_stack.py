"""Fine bits that blur has washed out: left out pixel by pixel, and the variance says so."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.decoding.coordinate_noise import with_measured_noise
from mitsuba_endo.decoding.stack import DecodedStack, Stack, decode_stack
from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import StackPlan
from mitsuba_endo.robust import robust_std
from tests.decoding.captures import SIZE, View, inner, photograph, view

PLAN = StackPlan.make("gray", *SIZE, inverse=True)
BLUR = 3.0
"""Camera pixels, standard deviation: of the finest bits, whose stripes repeat every 4 and 8 pixels,
exp(-2 pi^2 BLUR^2 / period^2) is left: 0.00 and 0.06."""
BORDER = 9
"""Pixels at the image's border, where the pictures' blur is not that of a lens."""


@cache
def scene() -> View:
    return view()


@cache
def blurred(blur: float, inverse: bool = True, noise: float = 0.006) -> DecodedStack:
    plan = StackPlan.make("gray", *SIZE, inverse=inverse)
    stack = photograph(scene(), patterns(plan), blur=blur, noise=noise)
    return decode_stack(stack, plan)


def judged(decoded: DecodedStack) -> NDArray[np.bool_]:
    inside = np.zeros(decoded.lit.shape, bool)
    inside[BORDER:-BORDER, BORDER:-BORDER] = True
    return decoded.decoded & inside & np.isfinite(scene().rig.q[..., 0])


@pytest.mark.parametrize(("inverse", "noise"), [(True, 0.006), (True, 0.015), (False, 0.006)])
def test_pixels_are_kept_and_errors_are_as_large_as_stated(inverse: bool, noise: float):
    """Oracle: ray casting. The two finest bits are unreadable, at every pixel that is well lit."""
    decoded = blurred(BLUR, inverse, noise)
    assert (decoded.left_out >= 2)[decoded.decoded & inner(scene())].mean() > 0.85
    assert decoded.decoded.sum() > 0.9 * decoded.lit.sum()
    good = judged(decoded)
    error = (decoded.q - scene().rig.q)[good]
    normalised = error / np.sqrt(decoded.variance[good])[:, None]
    assert 0.7 < np.sqrt((normalised**2).mean()) < 1.4
    assert 0.7 < robust_std(normalised) < 1.4


def test_less_weight_means_more_error():
    """Oracle: ray casting, on pixels of which the left third alone is blurred."""
    sharp, soft = (photograph(scene(), patterns(PLAN), blur=blur) for blur in (0.6, 2.0))
    images = sharp.images.copy()
    images[:, :, :120] = soft.images[:, :, :120]
    decoded = decode_stack(Stack(images, images >= 1, 255), PLAN)
    good = judged(decoded)
    error = np.abs(decoded.q - scene().rig.q).mean(-1)
    left = good & (np.arange(272) < 110)
    right = good & (np.arange(272) > 130)
    for side, bits in ((left, 1), (right, 0)):
        assert np.median(decoded.left_out[side]) == bits
    ratio = np.median(error[left]) / np.median(error[right])
    stated = np.sqrt(np.median(decoded.variance[left]) / np.median(decoded.variance[right]))
    assert ratio > 1.2
    assert 0.6 < stated / ratio < 1.6
    assert decoded.weight.max() == 1
    assert (decoded.weight[~decoded.decoded] == 0).all()
    np.testing.assert_allclose(
        decoded.weight[right][:50] * decoded.variance[right][:50],
        np.minimum(np.percentile(decoded.variance[decoded.decoded], 1),
                   decoded.variance[right][:50]), rtol=1e-4,
    )  # fmt: skip


def test_sharp_stacks_lose_nothing():
    """Oracle: the contract; a tenth of the stripe's width is what blur of a pixel allows."""
    decoded = blurred(0.6)
    assert (decoded.left_out > 0)[decoded.decoded].mean() < 0.01
    error = np.abs(decoded.q - scene().rig.q)[judged(decoded)]
    assert np.median(error) < 0.05


def test_measured_noise():
    """Oracle: the noise put in, on a slope of a stripe per pixel; alone, a stripe's width."""
    rng = np.random.default_rng(0)
    slope = np.arange(120, dtype=np.float32) + np.zeros((90, 1), np.float32)
    noisy = slope + rng.normal(0, 0.2, slope.shape).astype(np.float32)
    stated, none = np.full(slope.shape, np.float32(0.1)), np.zeros(slope.shape, np.uint8)
    found = with_measured_noise(noisy, stated, 1.0, none)
    assert np.median(found) == pytest.approx(0.2, rel=0.05)
    few = np.full(slope.shape, np.float32(np.nan))
    few[5, 5] = 3
    assert with_measured_noise(few, stated, 2.0, none)[5, 5] == pytest.approx(
        np.hypot(0.1, 2 / 12**0.5), rel=1e-4
    )
