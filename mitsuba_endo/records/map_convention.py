"""How other tools count and order projector coordinates, and the way from there to ours."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, shown

T = TypeVar("T", bound=np.generic)
OPTION = "--map-convention"
Size = tuple[int, int]
"""Width and height of the pattern, pixels."""


@dataclass(frozen=True)
class MapConvention:
    """What the numbers of a map mean; by default what they mean here."""

    origin: str = "zero-based"
    """Where counting begins; one of :data:`ORIGINS`."""
    signed: bool = False
    """Normalised coordinates reach from -1 to 1."""
    swapped: bool = False
    """y comes before x."""
    x_mirrored: bool = False
    """x is counted from the pattern's right."""
    y_upwards: bool = False
    """y is counted from the pattern's bottom."""
    transposed: bool = False
    """The map's first index is the camera's column."""
    missing: tuple[float, ...] = ()
    """Values of either coordinate that stand for missing."""
    channels: tuple[str, str] | None = None
    """Names of the channels or arrays of x and y."""

    def affine(self, size: Size | None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return A (2, 2) and b (2,), so that A q + b is in pattern pixels from 0.

        Args:
            size: of the pattern, which mirrored and normalised coordinates depend on.

        Raises:
            InputError: they do, and no size is given.
        """
        if size is None and self._needs_size:
            todo = "give the rig, or store pattern pixels"
            raise InputError("needs the pattern's size", OPTION, todo)
        extent = np.array(size or (1, 1), float)
        A = np.array([[0.0, 1], [1, 0]]) if self.swapped else np.eye(2)
        b = np.zeros(2)
        if self.signed:
            A, b = A / 2, (b + 1) / 2
        scale, shift = ORIGINS[self.origin](extent)
        A, b = scale[:, None] * A, scale * b + shift
        sign = np.where([self.x_mirrored, self.y_upwards], -1.0, 1.0)
        return sign[:, None] * A, np.where(sign < 0, extent - 1 - b, b)

    @property
    def _needs_size(self) -> bool:
        normalised = self.origin in ("normalised", "normalised-centres")
        return normalised or self.x_mirrored or self.y_upwards

    def upright(self, array: NDArray[T]) -> NDArray[T]:
        """Return an array (H, W, ...) indexed by the camera's row first."""
        return np.ascontiguousarray(array.swapaxes(0, 1)) if self.transposed else array

    def coordinates(self, q: NDArray[np.float32], size: Size | None) -> NDArray[np.float32]:
        """Return coordinates (H, W, 2) as they are counted here, NaN = missing.

        Raises:
            InputError: as :meth:`affine`.
        """
        A, b = self.affine(size)
        gone = np.asarray(np.isin(q, np.array(self.missing, np.float32)).any(-1, keepdims=True))
        q = np.where(gone, np.float32(np.nan), q)
        if np.array_equal(A, np.eye(2)) and not b.any():
            return self.upright(q)
        return self.upright((q @ A.T + b).astype(np.float32))

    def covariance(self, xx_xy_yy: NDArray[np.float32], size: Size | None) -> NDArray[np.float32]:
        """Return covariances (H, W, 3) of the coordinates that :meth:`coordinates` returns.

        Raises:
            InputError: as :meth:`affine`.
        """
        A, _ = self.affine(size)
        full = xx_xy_yy[..., [0, 1, 1, 2]].reshape(*xx_xy_yy.shape[:2], 2, 2)
        turned = (A @ full @ A.T).reshape(*xx_xy_yy.shape[:2], 4)
        return self.upright(turned[..., [0, 1, 3]].astype(np.float32))


AS_STORED = MapConvention()

ORIGINS = {
    "zero-based": lambda extent: (np.ones(2), np.zeros(2)),
    "one-based": lambda extent: (np.ones(2), -np.ones(2)),
    "corner-based": lambda extent: (np.ones(2), np.full(2, -0.5)),
    "normalised": lambda extent: (extent, np.full(2, -0.5)),
    "normalised-centres": lambda extent: (extent - 1, np.zeros(2)),
}
"""Factor and shift to pixels from 0 at the first pixel's centre: counted from 1; from the first
pixel's corner; from 0 to 1 between the pattern's edges, or between its first and last pixel."""
WORDS: dict[str, tuple[str, object]] = {
    **{name: ("origin", name) for name in ORIGINS},
    "signed": ("signed", True),
    "swapped": ("swapped", True),
    "x-mirrored": ("x_mirrored", True),
    "y-upwards": ("y_upwards", True),
    "transposed": ("transposed", True),
}
"""What each word states; ``missing=VALUE`` and ``channels=X/Y`` state the rest."""


def read_map_convention(text: str) -> MapConvention:
    """Read words, separated by commas; see WORDS.

    Raises:
        InputError: an unknown word, two that contradict each other, or ``signed`` of pixels.
    """
    parts: dict[str, object] = {}
    missing: list[float] = []
    for word in filter(None, (part.strip() for part in text.split(","))):
        name, value = _stated(word)
        if name == "missing":
            missing.append(float(str(value)))
        elif parts.setdefault(name, value) != value:
            raise InputError(f"{shown(word)} contradicts another word", OPTION, "state one of both")
    convention = replace(AS_STORED, missing=tuple(missing), **parts)  # type: ignore[arg-type]
    if convention.signed and not convention.origin.startswith("normalised"):
        todo = "add normalised or normalised-centres"
        raise InputError("'signed' is for normalised coordinates", OPTION, todo)
    return convention


def _stated(word: str) -> tuple[str, object]:
    if word in WORDS:
        return WORDS[word]
    name, _, value = word.partition("=")
    names = tuple(part.strip() for part in value.split("/"))
    if name == "channels" and len(names) == 2 and all(names):
        return name, names
    if name == "missing":
        try:
            return name, float(value)
        except ValueError:
            pass
    choices: Sequence[str] = (*WORDS, "missing=VALUE", "channels=X/Y")
    raise InputError(f"unknown {shown(word)}", OPTION, f"choose from {', '.join(choices)}")
