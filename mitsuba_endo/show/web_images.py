"""Maps and figures as images inside a web page."""

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import matplotlib
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import Normalize, to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..records.calibration import FrameMaps
from . import surface_colours
from .colours import MISSING, RESIDUAL, UNUSED, banded, shaded
from .panels import coordinate_limits, residual_range
from .surface_colours import Shown
from .view import SurfaceView

_PIXELS = 5_000_000
"""Of all maps together: keeps the page below 3 MB whatever the number of frames."""
_MAX_SIDE = 640
"""Pixels of a map's longer side. Chosen, as is the quality, for pages of few MB."""
_QUALITY = 85
"""Of WebP, 0 to 100."""


@dataclass(frozen=True)
class ColourBar:
    """A colour bar."""

    image: str
    """Data URI of a strip, low to high."""
    low: str
    high: str
    note: str


@dataclass(frozen=True)
class MapImages:
    """Images of one coordinate in one frame, data URIs."""

    observed: str
    rendered: str
    residual: str


@dataclass(frozen=True)
class ShownImage:
    """An image of a quantity with its scale."""

    name: str
    source: str
    bar: ColourBar


@dataclass(frozen=True)
class MapPages:
    """Images of all frames; the two coordinates, x and y, are the inner lists."""

    images: list[list[MapImages]]
    coordinate_scales: list[ColourBar]
    residual_scale: ColourBar
    shrink: float
    """By which images are smaller than the maps."""


def map_pages(frames: Sequence[FrameMaps]) -> MapPages:
    """Colour the maps of all frames on common scales."""
    limits = [coordinate_limits(frames, c) for c in (0, 1)]
    scales = [banded(float(low), float(high)) for low, high in limits]
    limit = residual_range(frames)
    height, width = frames[0].observed.shape[:2]
    room = math.sqrt(_PIXELS / (6 * len(frames) * width * height))
    shrink = min(1.0, room, _MAX_SIDE / max(width, height))
    images = [
        [
            MapImages(
                _uri(_coloured(frame.observed[..., c], *scales[c][:2]), shrink),
                _uri(_coloured(frame.rendered[..., c], *scales[c][:2]), shrink),
                _uri(_residual(frame, c, limit), shrink),
            )
            for c in (0, 1)
        ]
        for frame in frames
    ]
    bars = [
        _scale(colours, norm, f"projector {name}, pattern px, bands of {step:g}")
        for name, (colours, norm, step) in zip("xy", scales, strict=True)
    ]
    note = "observed - rendered, pattern px; dark grey: not used"
    residuals = _scale(matplotlib.colormaps[RESIDUAL], Normalize(-limit, limit), note)
    return MapPages(images, bars, residuals, shrink)


def figure_svg(figure: Figure) -> str:
    """Return a line drawing as the data URI of an SVG."""
    buffer = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "report"}):
        # Of the canvas: the figure's own savefig draws everything twice.
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    return _data_uri("image/svg+xml", buffer.getvalue())


def depth_image(view: SurfaceView, unit: str) -> ShownImage:
    """Return the depth of a surface in its camera, shaded to show its relief."""
    shown = surface_colours.depth([view.points.reshape(-1, 3)], unit)
    norm = Normalize(shown.low, shown.high)
    return _shown(shown, shaded(view.depth, view.normals, shown.scale, norm)[..., :3])


def value_image(shown: Shown, height: int, width: int) -> ShownImage:
    """Return the image of a quantity that has a value for every pixel, in rows."""
    return _shown(shown, shown.rgb(0).reshape(height, width, 3) / 255)


def _shown(shown: Shown, image: NDArray[np.float64]) -> ShownImage:
    norm = Normalize(shown.low, shown.high)
    bar = _scale(matplotlib.colormaps[shown.scale], norm, shown.label)
    return ShownImage(shown.name, _uri(image, min(1.0, _MAX_SIDE / max(image.shape))), bar)


def photograph_uri(image: NDArray[np.uint8], shrink: float) -> str:
    """Return a photograph (H, W, 3), RGB, made smaller by a factor, as a data URI."""
    return _uri(image.astype(np.float64) / 255, shrink)


def _coloured(q: NDArray[Any], colours: Any, norm: Normalize) -> NDArray[np.float64]:
    return colours(norm(np.ma.masked_invalid(q)))[..., :3]


def _residual(frame: FrameMaps, channel: int, limit: float) -> NDArray[np.float64]:
    values = frame.residual[..., channel]
    image = matplotlib.colormaps[RESIDUAL](Normalize(-limit, limit)(np.nan_to_num(values)))[..., :3]
    image[~(frame.used & np.isfinite(values))] = to_rgb(MISSING)
    image[np.isfinite(frame.observed).all(-1) & ~frame.used] = to_rgb(UNUSED)
    return image


def _scale(colours: Any, norm: Normalize, note: str) -> ColourBar:
    low, high = float(norm.vmin or 0), float(norm.vmax or 0)
    strip = colours(np.linspace(0, 1, 360, endpoint=False))[None, :, :3]
    return ColourBar(_uri(strip, 1.0, lossless=True), f"{low:.3g}", f"{high:.3g}", note)


def _uri(rgb: NDArray[np.float64], shrink: float, lossless: bool = False) -> str:
    """Encode an (H, W, 3) image, 0 to 1, made smaller by a factor."""
    image = np.ascontiguousarray(np.round(255 * rgb[..., ::-1]).astype(np.uint8))
    if shrink < 1:
        size = [max(1, round(shrink * n)) for n in image.shape[1::-1]]
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    quality = 101 if lossless else _QUALITY
    done, data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, quality])
    assert done  # OpenCV's wheels hold the encoder
    return _data_uri("image/webp", data.tobytes())


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
