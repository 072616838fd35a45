"""All effects of camera and laser, one after the other."""

import numpy as np
from numpy.typing import NDArray

from ..settings import Effects
from .defocus import defocus
from .encoding import Encoded, encode
from .exposure import exposure_gain, to_gray
from .jpeg import jpeg
from .motion import motion_blur
from .sensor_noise import sensor_noise
from .speckle import speckle
from .vignetting import vignetting, wide_angle_cosine

_SPECKLE, _SENSOR = 1, 2
"""Numbers of the random streams."""


def apply_effects(
    radiance: NDArray[np.floating],
    effects: Effects,
    seed: int,
    *,
    laser: NDArray[np.floating] | None = None,
    cosine: NDArray[np.floating] | None = None,
) -> Encoded:
    """Turn radiance into the image that a camera would deliver.

    Order: vignetting, defocus, motion blur, speckle on the laser's part, exposure, shot and read
    noise with saturation, gamma and quantisation, JPEG. Each random stage has a generator of its
    own, so that switching one off leaves the others' noise as it was.

    Args:
        radiance: (h, w) or (h, w, 3) linear.
        effects: the stages' parameters.
        seed: the same seed gives the same image.
        laser: the laser's part of ``radiance``, of its shape, which alone has speckle. Default:
            all of it.
        cosine: (h, w) cosine of the angle between a pixel's ray and the optical axis. Default: a
            pinhole camera of 90 degrees along the diagonal.

    Returns:
        (h, w) for one channel or ``colour="gray"``, else (h, w, 3); uint8 or uint16.
    """
    image = _channels(radiance, effects.colour)
    cosine = wide_angle_cosine(*image.shape[:2]) if cosine is None else cosine
    if laser is None:
        image = lit = _through_lens(image, cosine, effects)
    else:
        lit = _through_lens(_channels(laser, effects.colour), cosine, effects)
        image = _through_lens(image, cosine, effects)
    gain = exposure_gain(image, effects.exposure, effects.auto_exposure)
    if effects.speckle_contrast:
        grains = speckle(image.shape[:2], effects.speckle_contrast, effects.speckle_grain,
                         _generator(seed, _SPECKLE))  # fmt: skip
        image = image + lit * (grains - 1)[..., None]
    signal = image * np.float32(gain)
    if effects.shot is not None:
        signal = sensor_noise(signal, effects.shot, effects.read_noise, _generator(seed, _SENSOR))
    encoded = encode(signal, effects.gamma, effects.bits)
    if effects.jpeg_quality is not None:
        encoded = jpeg(encoded.astype(np.uint8), effects.jpeg_quality)
    return encoded[..., 0] if encoded.shape[2] == 1 else encoded


def _channels(image: NDArray[np.floating], colour: str) -> NDArray[np.float32]:
    array = np.asarray(image, np.float32)
    array = array[..., None] if array.ndim == 2 else array
    return to_gray(array) if colour == "gray" else array


def _through_lens(
    image: NDArray[np.float32], cosine: NDArray[np.floating], effects: Effects
) -> NDArray[np.float32]:
    image = vignetting(image, cosine, effects.vignetting)
    image = defocus(image, effects.defocus)
    return motion_blur(image, effects.motion, effects.motion_angle)


def _generator(seed: int, stage: int) -> np.random.Generator:
    return np.random.default_rng([seed, stage])
