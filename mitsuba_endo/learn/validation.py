"""Fixed images on views, codes and noise that are never trained on, by scenario."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..capture.settings import Effects
from ..decoding.network import CHANNELS, read_heads
from ..decoding.normalise import normalise
from .cache import ViewCache
from .compose import Appearance, Targets, compose
from .patterns import grid_texture
from .pixel_metrics import PixelMetrics, pixel_metrics

UNSEEN = 5000
"""First seed of the grids used here, above all that training uses."""
FOLDED = ("colon", "tube")
SCENARIOS = ("clean smooth", "clean folded", "heavy smooth", "heavy folded")


@dataclass(frozen=True, eq=False)
class ValidationImage:
    """One network input with its truth."""

    scenario: str
    image: NDArray[np.float32]
    truth: Targets


def validation_images(views: ViewCache) -> list[ValidationImage]:
    """Return one clean and one heavily corrupted image of each view."""
    images = []
    for index, kind in enumerate(views.kinds):
        for clean in (True, False):
            rng = np.random.default_rng((UNSEEN, index, int(clean)))
            appearance, effects = clean_image() if clean else heavy_image(rng)
            grid = grid_texture(UNSEEN + index)
            image, truth = compose(views.view(index), grid, appearance, effects, rng)
            name = f"{'clean' if clean else 'heavy'} {'folded' if kind in FOLDED else 'smooth'}"
            images.append(ValidationImage(name, normalise(image), truth))
    return images


def clean_image() -> tuple[Appearance, Effects]:
    """Return dry tissue, sharp and well exposed."""
    appearance = Appearance(scatter=0.9, free_path=1.0, reflectance=0.35, between=0.05, lamp=0.05,
                            wet=0.0, tint=(2, 0.8))  # fmt: skip
    effects = Effects(vignetting=0.5, defocus=0.5, speckle_contrast=0.0, exposure=1.0,
                      colour="gray", shot=20000, read_noise=4)  # fmt: skip
    return appearance, effects


def heavy_image(rng: np.random.Generator) -> tuple[Appearance, Effects]:
    """Return wet tissue with speckle contrast 0.5 to 0.8 and exposure 0.3 to 0.5."""
    u = rng.uniform
    appearance = Appearance(scatter=u(0.7, 1), free_path=u(1, 2.5), reflectance=0.35, between=0.15,
                            lamp=u(0.05, 0.3), wet=3, tint=(2, 0.8))  # fmt: skip
    effects = Effects(
        vignetting=1.0, defocus=u(0.4, 0.8), motion=u(0, 1.5), motion_angle=u(0, 3.14),
        speckle_contrast=round(u(0.5, 0.8), 2), speckle_grain=u(1.2, 2.2), exposure=u(0.3, 0.5),
        colour="colour" if rng.random() < 0.5 else "gray", shot=6000, read_noise=12,
        gamma=float(rng.choice([1.0, 2.2])),
    )  # fmt: skip
    return appearance, effects


def evaluate(
    images: list[ValidationImage], network: Callable[[NDArray[np.float32]], NDArray[np.float32]]
) -> dict[str, PixelMetrics]:
    """Return the metrics of each scenario.

    Args:
        images: to decode.
        network: maps (2, H, W) to (9, H, W).
    """
    heads = [read_heads(network(image.image), CHANNELS) for image in images]
    scores = {}
    for scenario in SCENARIOS:
        chosen = [k for k, image in enumerate(images) if image.scenario == scenario]
        if chosen:
            truths = [images[k].truth for k in chosen]
            scores[scenario] = pixel_metrics([heads[k] for k in chosen], truths)
    return scores
