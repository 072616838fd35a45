"""Each stage against the formula that it states."""

import time

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from mitsuba_endo.capture.effects import apply_effects
from mitsuba_endo.capture.effects.defocus import defocus
from mitsuba_endo.capture.effects.encoding import encode, linear
from mitsuba_endo.capture.effects.exposure import exposure_gain, to_gray
from mitsuba_endo.capture.effects.jpeg import jpeg
from mitsuba_endo.capture.effects.motion import motion_blur
from mitsuba_endo.capture.effects.sensor_noise import sensor_noise
from mitsuba_endo.capture.effects.speckle import speckle
from mitsuba_endo.capture.effects.vignetting import vignetting, wide_angle_cosine
from mitsuba_endo.capture.photograph import cosine_to_axis
from mitsuba_endo.capture.settings import Effects
from mitsuba_endo.geometry.cameras import CameraModel

PLAIN = Effects(
    vignetting=0, defocus=0, speckle_contrast=0, auto_exposure=False, shot=None, gamma=1
)
"""No effect but quantisation."""


def _scene(seed: int = 0) -> np.ndarray:
    """A smooth asymmetric colour image (90, 130, 3) in [0, 0.8]."""
    rough = np.random.default_rng(seed).random((90, 130, 3)).astype(np.float32)
    smooth = cv2.GaussianBlur(rough, (0, 0), 5)
    return (0.8 * (smooth - smooth.min()) / np.ptp(smooth)).astype(np.float32)


def test_variance_over_mean_is_the_photon_transfer_line() -> None:
    """Oracle: var = s / full_well + (read / full_well)^2; 5 standard errors of a variance."""
    full_well, read = 2000.0, 20.0
    for level in (0.005, 0.02, 0.2, 0.6):
        signal = np.full((200, 300, 1), level, np.float32)
        noisy = sensor_noise(signal, full_well, read, np.random.default_rng(3))
        expected = level / full_well + (read / full_well) ** 2
        n = signal.size
        assert noisy.mean() == pytest.approx(level, abs=5 * np.sqrt(expected / n))
        assert noisy.var() == pytest.approx(expected, rel=5 * np.sqrt(2 / n))


def test_dark_pixels_count_whole_electrons() -> None:
    """Oracle: without read noise the probability of no electron is exp(-mean)."""
    signal = np.full((300, 300, 1), 1e-3, np.float32)
    electrons = 1000 * sensor_noise(signal, 1000.0, 0.0, np.random.default_rng(1))
    np.testing.assert_allclose(electrons, np.round(electrons), atol=1e-4)
    assert (electrons < 0.5).mean() == pytest.approx(np.exp(-1), abs=5 * 0.48 / 300)


def test_nothing_exceeds_the_full_well_but_read_noise() -> None:
    """Oracle: clipping at full well comes before reading."""
    signal = np.full((50, 60, 1), 1.5, np.float32)
    assert (sensor_noise(signal, 900.0, 0.0, np.random.default_rng(0)) == 1).all()


@pytest.mark.parametrize("contrast", [0.15, 0.5, 1.0])
def test_speckle_follows_the_gamma_law(contrast: float) -> None:
    """Oracle: mean 1, standard deviation `contrast`, skewness 2 contrast of the gamma law.

    256 x 384 pixels hold about 10,000 independent grains of 3 pixels: 1 % of the mean, 5 % on the
    deviation and 0.25 on the skewness of the exponential law are four standard errors.
    """
    field = speckle((256, 384), contrast, 3.0, np.random.default_rng(5)).astype(np.float64)
    assert field.mean() == pytest.approx(1, abs=0.04 * contrast)
    assert field.std() == pytest.approx(contrast, rel=0.05)
    skewness = ((field - field.mean()) ** 3).mean() / field.std() ** 3
    assert skewness == pytest.approx(2 * contrast, abs=0.25)
    assert field.min() >= 0


@pytest.mark.parametrize(("contrast", "grain"), [(0.3, 2.0), (1.0, 4.0), (0.6, 7.0)])
def test_speckle_has_the_grain_that_is_asked_for(contrast: float, grain: float) -> None:
    """Oracle: full width at half maximum of the measured autocovariance, both axes."""
    field = speckle((400, 600), contrast, grain, np.random.default_rng(2))
    for axis in (0, 1):
        assert _covariance_width(field, axis) == pytest.approx(grain, rel=0.08)


def _covariance_width(field: np.ndarray, axis: int) -> float:
    centred = np.moveaxis(field - field.mean(), axis, 0).astype(np.float64)
    length = len(centred)
    values = [(centred[: length - d] * centred[d:]).mean() for d in range(12)]
    fine = np.linspace(0, 11, 1101)
    covariance = np.interp(fine, np.arange(12), values) / values[0]
    return 2 * float(fine[np.argmax(covariance < 0.5)])


def test_speckle_lies_on_the_laser_alone() -> None:
    """Oracle: without laser light the image is the one without speckle."""
    scene = _scene()
    quiet = apply_effects(scene, PLAIN, 1)
    grainy = PLAIN.model_copy(update={"speckle_contrast": 0.8})
    np.testing.assert_array_equal(
        apply_effects(scene, grainy, 1, laser=np.zeros_like(scene)), quiet
    )
    half = apply_effects(scene, grainy, 1, laser=scene * np.float32([0, 1, 0]))
    np.testing.assert_array_equal(half[..., 0], quiet[..., 0])
    assert (half[..., 1] != quiet[..., 1]).mean() > 0.5


@pytest.mark.parametrize("sigma", [0.8, 2.0, 3.5])
def test_defocus_spreads_a_point_by_its_sigma(sigma: float) -> None:
    """Oracle: second moments of a blurred point; total light is kept."""
    point = np.zeros((61, 71, 1), np.float32)
    point[30, 36] = 1
    blurred = defocus(point, sigma)[..., 0].astype(np.float64)
    assert blurred.sum() == pytest.approx(1, abs=1e-5)
    y, x = np.mgrid[:61, :71]
    assert (blurred * (x - 36) ** 2).sum() == pytest.approx(sigma**2, rel=0.03)
    assert (blurred * (y - 30) ** 2).sum() == pytest.approx(sigma**2, rel=0.03)


def test_motion_spreads_a_point_along_its_way() -> None:
    """Oracle: moments of a uniform line: length^2 / 12 along, and nothing odd.

    Bilinear sampling adds at most 1/4 px^2 to each variance.
    """
    length, angle = 9.0, 0.5
    point = np.zeros((51, 61, 1), np.float32)
    point[25, 30] = 1
    blurred = motion_blur(point, length, angle)[..., 0].astype(np.float64)
    assert blurred.sum() == pytest.approx(1, abs=1e-5)
    y, x = np.mgrid[:51, :61]
    along = (x - 30) * np.cos(angle) + (y - 25) * np.sin(angle)
    across = (y - 25) * np.cos(angle) - (x - 30) * np.sin(angle)
    assert 0 <= (blurred * along**2).sum() - length**2 / 12 < 0.25
    assert 0 <= (blurred * across**2).sum() < 0.25
    assert (blurred * along).sum() == pytest.approx(0, abs=1e-4)


def test_vignetting_is_the_fourth_power_of_the_cosine() -> None:
    """Oracle: cos^4 of the angle of each pixel's ray, by the camera's matrix."""
    K = np.array([[80.0, 0, 60.2], [0, 70.0, 41.5], [0, 0, 1]])
    camera = CameraModel("opencv", 130, 90, K)
    flat = np.ones((90, 130, 1), np.float32)
    falloff = vignetting(flat, cosine_to_axis(camera), 1.0)[..., 0]
    y, x = np.mgrid[:90, :130]
    ray = np.stack([(x - 60.2) / 80, (y - 41.5) / 70, np.ones(x.shape)], -1)
    np.testing.assert_allclose(falloff, 1 / np.linalg.norm(ray, axis=-1) ** 4, rtol=1e-5)
    corner = wide_angle_cosine(90, 130)[0, 0]
    assert corner == pytest.approx(np.sqrt(0.5), abs=0.01)  # 45 degrees off axis


@pytest.mark.parametrize("bits", [8, 16])
def test_quantisation_error_is_uniform(bits: int) -> None:
    """Oracle: error within half a step, of variance step^2 / 12."""
    signal = np.random.default_rng(0).random((200, 200, 1), np.float32)
    step = 1 / (2**bits - 1)
    image = encode(signal, 1.0, bits)
    assert image.dtype == (np.uint8 if bits == 8 else np.uint16)
    error = image.astype(np.float64) * step - signal
    assert np.abs(error).max() <= 0.5 * step * 1.01  # single precision
    assert error.var() == pytest.approx(step**2 / 12, rel=0.05)


def test_gamma_is_undone_by_linear() -> None:
    """Oracle: the encoded value is round(255 v^(1/2.2)); decoding is its inverse."""
    signal = np.linspace(0, 1, 500, dtype=np.float32).reshape(20, 25, 1)
    image = encode(signal, 2.2, 8)
    np.testing.assert_array_equal(
        image, np.floor(255 * signal.astype(np.float64) ** (1 / 2.2) + 0.5)
    )
    np.testing.assert_allclose(linear(image, 2.2), signal, atol=2.2 / 255)


def test_automatic_exposure_puts_the_bright_end_to_full_scale() -> None:
    """Oracle: 0.5 % of the pixels are clipped at exposure 1, none at a hundredth."""
    scene = 37.0 * _scene()
    gain = exposure_gain(scene, 1.0, True)
    assert (gain * scene.max(-1) > 1).mean() == pytest.approx(0.005, abs=1e-3)
    assert exposure_gain(scene, 0.01, True) == pytest.approx(gain / 100)
    assert exposure_gain(0 * scene, 2.0, True) == 2.0


def test_gray_is_the_luminance() -> None:
    """Oracle: Rec. 709 weights."""
    rgb = np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1]]], np.float32)
    np.testing.assert_allclose(to_gray(rgb)[0, :, 0], [0.2126, 0.7152, 0.0722])
    gray = apply_effects(_scene(), PLAIN.model_copy(update={"colour": "gray"}), 0)
    assert gray.shape == (90, 130)


def test_jpeg_keeps_colours_in_their_order_and_gets_worse_with_less_quality() -> None:
    """Oracle: the image itself; error grows as quality falls."""
    image = encode(_scene() * np.float32([1.0, 0.5, 0.1]), 2.2, 8)
    errors = [
        np.abs(jpeg(image.astype(np.uint8), q).astype(int) - image).mean() for q in (95, 60, 15)
    ]
    assert errors[0] < 2
    assert errors[0] < errors[1] < errors[2]


def test_the_same_seed_gives_the_same_image() -> None:
    """Oracle: equality; another seed differs, and a stage's noise ignores other switches."""
    effects = PLAIN.model_copy(update={"shot": 5000.0, "read_noise": 10.0, "bits": 16})
    scene = _scene()
    first = apply_effects(scene, effects, 4)
    np.testing.assert_array_equal(first, apply_effects(scene, effects, 4))
    assert (first != apply_effects(scene, effects, 5)).mean() > 0.9
    grainy = effects.model_copy(update={"speckle_contrast": 0.5})
    dark = apply_effects(scene, grainy, 4, laser=np.zeros_like(scene))
    np.testing.assert_array_equal(first, dark)


def test_plain_effects_are_the_image_itself() -> None:
    """Oracle: rounding to 8 bits is all that is left."""
    scene = _scene()
    error = apply_effects(scene, PLAIN, 0) / 255.0 - scene
    assert np.abs(error).max() <= 0.5 / 255 * 1.001  # single precision
    assert apply_effects(scene[..., 0], PLAIN, 0).shape == (90, 130)


def test_effects_do_not_change_their_input() -> None:
    """Oracle: a copy."""
    scene = _scene()
    kept = scene.copy()
    apply_effects(scene, Effects(motion=3, jpeg_quality=80), 1, laser=scene)
    np.testing.assert_array_equal(scene, kept)


def test_a_gray_training_image_takes_milliseconds() -> None:
    """Oracle: the requirement of the decoder's training, 20 ms at 320 x 240 without JPEG.

    Time of the processor, the least of several, because other work only adds to it.
    """
    image = np.random.default_rng(0).random((240, 320)).astype(np.float32)
    spent = []
    for seed in range(15):
        began = time.process_time()
        apply_effects(image, Effects(motion=2.0), seed)
        spent.append(time.process_time() - began)
    assert min(spent) < 0.02


@pytest.mark.parametrize(
    "wrong", [{"speckle_contrast": 1.2}, {"bits": 12}, {"jpeg_quality": 90, "bits": 16},
              {"shot": 0}, {"speckle": 1}],
)  # fmt: skip
def test_settings_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    """Oracle: the fields' documented ranges, and no unknown key."""
    with pytest.raises(ValidationError):
        Effects(**wrong)  # pyright: ignore[reportArgumentType]
