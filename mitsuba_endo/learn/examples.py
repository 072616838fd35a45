"""Endless, numbered training examples: the same number is the same example."""

from dataclasses import dataclass
from typing import TypedDict

import numpy as np
import torch  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray
from torch import Tensor  # pyright: ignore[reportMissingImports]
from torch.utils.data import Dataset  # pyright: ignore[reportMissingImports]

from ..capture.effects import apply_effects
from ..decoding.normalise import normalise
from .cache import ViewCache
from .compose import (
    Targets,
    compose,
    crop_view,
    no_targets,
    random_appearance,
    random_effects,
)
from .patterns import grid_texture
from .textures import without_pattern

NEGATIVE = 0.06
"""Share of examples that hold no grid."""
PATTERNS = 160
"""Different coded grids; each is also used upside down."""


class Example(TypedDict):
    """Tensors of one example, or of a batch with one more leading axis."""

    image: Tensor
    """(2, H, W) network input."""
    lattice: Tensor
    """(2, H, W)."""
    lit: Tensor
    """(H, W) bool."""
    code: Tensor
    """(H, W) int8, -1 = not asked for."""
    edge: Tensor
    """(H, W) bool."""


def example(image: NDArray[np.integer], targets: Targets) -> Example:
    """Join a photograph and its targets."""
    return {
        "image": torch.from_numpy(normalise(image)),
        "lattice": torch.from_numpy(targets.lattice),
        "lit": torch.from_numpy(targets.lit),
        "code": torch.from_numpy(targets.code),
        "edge": torch.from_numpy(targets.edge),
    }


@dataclass(frozen=True)
class TrainingExamples(Dataset[Example]):
    """Example ``first + k`` of the endless sequence that a seed starts, for k below ``count``."""

    views: ViewCache
    size: int
    """Pixels along each side."""
    seed: int
    first: int
    count: int

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Example:
        rng = np.random.default_rng((self.seed, 1, self.first + index))
        if rng.random() < NEGATIVE:
            return self._negative(rng)
        view = crop_view(self.views.view(int(rng.integers(len(self.views)))), self.size, rng)
        grid = grid_texture(int(rng.integers(PATTERNS)))
        grid = grid.turned() if rng.random() < 0.5 else grid
        return example(*compose(view, grid, random_appearance(rng), random_effects(rng), rng))

    def _negative(self, rng: np.random.Generator) -> Example:
        shape = (self.size, self.size)
        picture = without_pattern(shape, rng)
        image = apply_effects(picture, random_effects(rng), int(rng.integers(1 << 30)))
        return example(image, no_targets(shape))
