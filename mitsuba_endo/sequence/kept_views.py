"""Frames as the adjustment needs them again: coordinates packed into 16 bits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from .linearise import Poses
from .view import ThinnedMap, thinned

MOST = 160
"""Frames that are adjusted together, at most: twelve unknowns each, in one dense matrix."""
SMALL = 160
"""Columns, at most, that are kept of all other frames."""
_LEVELS = 65_000
"""Steps of a packed coordinate: of a pattern of 560 pixels, a fiftieth of its noise."""


@dataclass(frozen=True, eq=False)
class KeptView:
    """Usable coordinates of a frame, and where it was tracked."""

    number: int
    name: str
    poses: Poses
    noise: float
    """Of a coordinate, pattern pixels."""
    camera: CameraModel
    codes: NDArray[np.uint16]
    """(H, W, 2) steps above ``lowest``, from 1; 0 = missing."""
    lowest: float
    step: float

    @classmethod
    def of(cls, number: int, view: ThinnedMap, poses: Poses, noise: float) -> "KeptView":
        """Pack a frame."""
        q = np.where(view.usable[..., None], view.q, np.nan)
        lowest, highest = (float(f(q)) for f in (np.nanmin, np.nanmax))
        step = max(highest - lowest, 1e-6) / _LEVELS
        codes = np.nan_to_num(np.rint((q - lowest) / step) + 1).astype(np.uint16)
        return cls(number, view.name, poses, noise, view.camera, codes, lowest, step)

    @property
    def view(self) -> ThinnedMap:
        """Unpack the frame."""
        usable = np.asarray((self.codes > 0).all(-1))
        q = self.lowest + self.step * (self.codes.astype(np.float64) - 1)
        return ThinnedMap(self.name, self.camera, np.where(usable[..., None], q, np.nan), usable)

    def every(self, step: int, camera: CameraModel) -> "KeptView":
        """Return the frame with every ``step``-th pixel, seen by the camera that has these."""
        codes = np.ascontiguousarray(self.codes[::step, ::step])
        return KeptView(
            self.number, self.name, self.poses, self.noise, camera, codes, self.lowest, self.step
        )


class KeptViews:
    """Of one part: fused frames as they are, the others small."""

    def __init__(self, camera: CameraModel) -> None:
        self._step = -(-camera.width // SMALL)
        self._small = camera if self._step == 1 else thinned(camera, self._step)
        self.fused: list[KeptView] = []
        self.between: list[KeptView] = []

    def keep(
        self, number: int, view: ThinnedMap, poses: Poses, noise: float, *, fused: bool
    ) -> None:
        """Keep a placed frame; of too many fused ones every second becomes one of the others."""
        self.take(KeptView.of(number, view, poses, noise), fused=fused)

    def take(self, kept: KeptView, *, fused: bool) -> None:
        """Keep a packed frame likewise."""
        if not fused:
            self.between.append(self._reduced(kept))
            return
        self.fused.append(kept)
        if len(self.fused) > MOST:
            self.between += [self._reduced(k) for k in self.fused[1::2]]
            self.fused = self.fused[::2]

    def _reduced(self, kept: KeptView) -> KeptView:
        small = kept.camera.width == self._small.width
        return kept if small else kept.every(self._step, self._small)
