"""Colour scales that colour-blind readers can read as well."""

import math

import matplotlib
import numpy as np
from matplotlib.colors import Colormap, ListedColormap, Normalize, to_rgba
from numpy.typing import NDArray

MISSING = "#e4e4e4"
UNUSED = "#9c9c9c"
RESIDUAL = "PuOr_r"
DEPTH = "cividis_r"
"""Near is bright: walls close to the camera shine in a photograph too."""
CAMERA, PROJECTOR = "#0072b2", "#d55e00"  # of Okabe and Ito's colour-blind safe palette

_STEPS = 1024
"""Entries of a colour map. Chosen: borders of bands are then right to a thousandth of the range."""
_BANDS = 14
"""Bands wished for; round steps make them some more or fewer. Chosen for looks."""
_SHADE = 0.72
"""Brightness of every second band over that of the others. Chosen for looks."""


def round_step(extent: float, parts: int) -> float:
    """Return the 1, 2 or 5 times a power of ten nearest to ``extent / parts``."""
    wanted = extent / parts if extent > 0 else 1.0
    power = 10.0 ** math.floor(math.log10(wanted))
    return min((m * power for m in (1, 2, 5, 10)), key=lambda s: abs(math.log(s / wanted)))


def banded(low: float, high: float) -> tuple[Colormap, Normalize, float]:
    """Return a scale whose every second band is darker, so that band borders are iso-lines.

    Contour lines drawn from noisy maps tear into loops; bands stay readable, and outliers stand
    out as dots.

    Returns:
        The colour map, its range, and the width of a band in the unit of the values.
    """
    step = round_step(high - low, _BANDS)
    low, high = math.floor(low / step) * step, math.ceil(high / step) * step
    high = max(high, low + step)
    values = np.linspace(low, high, _STEPS, endpoint=False) + (high - low) / _STEPS / 2
    colours = matplotlib.colormaps["viridis"](np.linspace(0.08, 1, _STEPS))
    colours[np.floor(values / step) % 2 == 1, :3] *= _SHADE
    scale = ListedColormap(colours).with_extremes(bad=MISSING)
    return scale, Normalize(low, high), step


def shaded(
    values: NDArray[np.float64],
    normals: NDArray[np.float64],
    scale: str,
    norm: Normalize,
    relief: float = 0.6,
) -> NDArray[np.float64]:
    """Return an RGBA image of ``values`` (...) lit from the upper left; missing is light grey.

    Args:
        values: what the colour shows.
        normals: (..., 3) unit normals towards the camera, OpenCV axes.
        scale: name of the colour map.
        norm: range of the values.
        relief: how much darker the shadows are than what faces the light.
    """
    light = np.array([-0.5, -0.6, -0.62])
    facing = np.clip(np.nan_to_num(normals) @ (light / np.linalg.norm(light)), 0, 1)
    bright = 1.05 - relief + relief * facing
    image = matplotlib.colormaps[scale](norm(np.nan_to_num(values, nan=norm.vmin or 0.0)))
    image[..., :3] = np.clip(image[..., :3] * bright[..., None], 0, 1)
    image[~np.isfinite(values)] = to_rgba(MISSING)
    return image
