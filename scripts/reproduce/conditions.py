"""The settings of the robustness curves."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .capture import Capture, Truth, capture
from .decoder_noise import Plain
from .scenes import FOCAL, stomach_mesh, views_of


@dataclass(frozen=True)
class Condition:
    """One setting; the defaults are those of all other curves."""

    sigma: float = 0.3
    outliers: float = 0.01
    missing: float = 0.0
    baseline: float = 1.0
    """Over that of the scene, 6.3 mm."""
    frames: int = 1
    guess: float = 1.1
    """Starting focal length over the true one."""

    @property
    def noise(self) -> Plain:
        return Plain(self.sigma, self.outliers, self.missing)

    def capture(self, seed: int, width: int, folder: Path) -> tuple[Truth, Capture]:
        """Make the capture of one seed."""
        truth = views_of(stomach_mesh(seed), self.frames, seed, law="pinhole", width=width,
                         play=0.2, baseline=self.baseline)  # fmt: skip
        errors = partial(_read, self.noise, 10 * seed)
        return truth, capture(truth, truth.rig(self.guess * FOCAL), errors, folder)


CURVES: Mapping[str, tuple[str, tuple[float, ...]]] = {
    "sigma": ("noise (pattern px)", (0.1, 0.3, 0.6, 1.2)),
    "outliers": ("share of gross errors", (0.0, 0.1, 0.2, 0.3, 0.4)),
    "missing": ("share of the image missing", (0.0, 0.2, 0.4, 0.6)),
    "baseline": ("baseline / 6.3 mm", (0.25, 0.5, 1.0, 2.0)),
    "frames": ("frames", (1, 2, 4)),
    "guess": ("starting focal length / true", (0.5, 0.7, 0.9, 1.1, 1.5, 2.0)),
}


def _read(noise: Plain, seed: int, q: NDArray[np.float64], frame: int) -> NDArray[np.float64]:
    return noise.apply(q, seed + frame)
