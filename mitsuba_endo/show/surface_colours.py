"""What the colour of a surface can show: a value per vertex, its scale and its unit."""

from dataclasses import dataclass
from html import escape

import matplotlib
import numpy as np
from matplotlib.colors import to_hex, to_rgb
from numpy.typing import NDArray

from .colours import DEPTH, MISSING, RESIDUAL

Floats = NDArray[np.float64]

UNCERTAINTY = "YlOrBr"
"""Bright is certain: near walls, the most certain ones, would be black otherwise."""
_SHARE = 98
"""Percentile at which a scale ends: a few outliers would take all the colours."""


@dataclass(frozen=True, eq=False)
class Shown:
    """One quantity over all surfaces of a result, on one scale."""

    name: str
    """As it is chosen from a list."""
    label: str
    """With its unit, and in words what the ends of the scale mean."""
    values: list[Floats]
    """(V,) of every surface, NaN = unknown."""
    low: float
    high: float
    scale: str
    """Name of a colour map that colour-blind readers can read."""

    def share(self, surface: int) -> Floats:
        """Return where on the scale (V,) every vertex is, 0 to 1, NaN = unknown."""
        return np.clip((self.values[surface] - self.low) / (self.high - self.low), 0, 1)

    def strip(self, count: int = 256) -> NDArray[np.uint8]:
        """Return the scale's colours (count, 3), low to high."""
        colours = matplotlib.colormaps[self.scale](np.linspace(0, 1, count))
        return np.round(255 * colours[:, :3]).astype(np.uint8)

    def rgb(self, surface: int) -> NDArray[np.uint8]:
        """Return the colours (V, 3) of a surface's vertices."""
        share = self.share(surface)
        finite = np.isfinite(share)
        colours = matplotlib.colormaps[self.scale](np.where(finite, share, 0.0))[:, :3]
        colours[~finite] = to_rgb(MISSING)
        return np.round(255 * colours).astype(np.uint8)

    def legend(self) -> str:
        """Return a bar with its ends and label as HTML."""
        stops = ",".join(to_hex(c / 255) for c in self.strip(16))
        return (
            f'<div style="padding:2px 14px 8px;font-size:12px;line-height:1.4">'
            f'<div style="height:12px;border-radius:2px;background:linear-gradient(90deg,{stops})">'
            '</div><div style="display:flex;justify-content:space-between">'
            f"<span>{_number(self.low)}</span><span>{_number(self.high)}</span></div>"
            f"<div>{escape(self.label)}</div></div>"
        )


def uncertainty(stds: list[Floats], unit: str) -> Shown:
    """Show standard deviations (V,), the unit given."""
    top = _top(stds)
    label = f"standard deviation along the camera's rays, {unit}; dark is uncertain"
    return Shown("uncertainty", label, stds, 0.0, top, UNCERTAINTY)


def error(errors: list[Floats], unit: str, alignment: str) -> Shown:
    """Show signed differences (V,) from the truth."""
    top = _top([np.abs(e) for e in errors])
    aligned = "" if alignment == "none" else f", {alignment} aligned"
    label = f"found - true distance from the camera, {unit}{aligned}; orange is too far"
    return Shown("error to truth", label, errors, -top, top, RESIDUAL)


def depth(vertices: list[Floats], unit: str) -> Shown:
    """Show how far along its camera's axis every vertex (V, 3) lies."""
    values = [v[:, 2] for v in vertices]
    finite = _known(values)
    low, high = np.percentile(finite, [1, 99]) if len(finite) else (0.0, 1.0)
    label = f"depth in the camera, {unit}"
    return Shown("depth", label, values, float(low), float(max(high, low + 1e-9)), DEPTH)


def _top(values: list[Floats]) -> float:
    finite = _known(values)
    return max(float(np.percentile(finite, _SHARE)), 1e-12) if len(finite) else 1.0


def _known(values: list[Floats]) -> Floats:
    together = np.concatenate(values)
    return together[np.isfinite(together)]


def _number(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")
