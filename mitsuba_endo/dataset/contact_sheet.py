"""Contact sheets: every sample's photograph beside its truth, so that one look tells if it fits."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..files import atomic_path
from . import contents
from .contents import Stored
from .reader import Dataset

COLUMNS, ROWS = 3, 6
"""Tiles on a sheet: at their width it fits a screen."""
THUMB = 256
"""Width of a picture, pixels."""
GAP, LABEL = 8, 20
"""Pixels between tiles, and for a line of text."""
SHEETS = 16
"""Most sheets of one dataset; of larger ones, samples are chosen evenly."""
UNSEEN, SHADOW, LINE = (225, 225, 225), (70, 70, 80), (255, 255, 255)
"""8-bit RGB."""
DPI = 100
"""Dots per inch of the figure, which make 8 points of text 11 pixels high."""

Image = NDArray[np.uint8]


def write_contact_sheets(dataset: Dataset) -> list[Path]:
    """Write ``contact_sheet_00.png`` and so on beside the samples; return their paths.

    Raises:
        InputError: a sample is damaged, or the folder cannot be written.
    """
    per_sheet = COLUMNS * ROWS
    shown = min(len(dataset), SHEETS * per_sheet)
    chosen = np.linspace(0, len(dataset) - 1, shown).round().astype(int)
    for old in dataset.folder.glob("contact_sheet_[0-9][0-9].png"):
        old.unlink()
    paths = []
    for start in range(0, shown, per_sheet):
        path = dataset.folder / f"contact_sheet_{start // per_sheet:02d}.png"
        samples = [dataset[int(i)] for i in chosen[start : start + per_sheet]]
        _write_sheet(path, samples, f"seed {dataset.config.seed}")
        paths.append(path)
    return paths


def _write_sheet(path: Path, samples: list[Stored], title: str) -> None:
    from matplotlib.figure import Figure

    tiles = [np.hstack([photograph(s), _column(s), truth_picture(s)]) for s in samples]
    height, width = tiles[0].shape[:2]
    columns = min(COLUMNS, len(tiles))
    rows = -(-len(tiles) // columns)
    step_x, step_y = width + GAP, height + GAP + LABEL
    sheet = np.full((rows * step_y + GAP + LABEL, columns * step_x + GAP, 3), 255, np.uint8)
    size = sheet.shape[1] / DPI, sheet.shape[0] / DPI
    figure = Figure(figsize=size, dpi=DPI)
    for i, (tile, sample) in enumerate(zip(tiles, samples, strict=True)):
        x, y = GAP + i % columns * step_x, GAP + LABEL + i // columns * step_y
        sheet[y : y + height, x : x + width] = tile
        _text(figure, sheet, x, y + height + LABEL - 6, caption(sample))
    _text(figure, sheet, GAP, GAP + LABEL - 10, f"{title}: photograph | depth, grid lines, shadow")
    figure.figimage(sheet, 0, 0)
    with atomic_path(path) as aside:
        figure.savefig(aside, dpi=DPI)


def _text(figure: Any, sheet: Image, x: int, y: int, text: str) -> None:
    figure.text(x / sheet.shape[1], 1 - y / sheet.shape[0], text, fontsize=8, color="black")


def _column(sample: Stored) -> Image:
    """Return the gap between a sample's two pictures."""
    return np.full((_height(sample), 2, 3), 255, np.uint8)


def _height(sample: Stored) -> int:
    height, width = sample.arrays[contents.IMAGE].shape[:2]
    return round(THUMB * height / width)


def caption(sample: Stored) -> str:
    """Return number, kind and polyps of a sample."""
    description = sample.description
    sizes = ", ".join(f"{polyp['diameter']:.1f}" for polyp in description["polyps"])
    return f"{description['index']}  {description['kind']}" + (
        f", polyps {sizes} mm" if sizes else ""
    )


def photograph(sample: Stored) -> Image:
    """Return the thumbnail of the image, 8-bit RGB."""
    image = sample.arrays[contents.IMAGE]
    if image.dtype == np.uint16:
        image = (image >> 8).astype(np.uint8)
    if image.ndim == 2:
        image = np.repeat(image[..., None], 3, axis=2)
    return _resized(image, sample)


def truth_picture(sample: Stored) -> Image:
    """Return the thumbnail of the depth in colour, with the true grid lines where it is lit."""
    from matplotlib import colormaps

    arrays = sample.arrays
    depth, camera = arrays[contents.DEPTH], arrays["camera"]
    low, high = np.percentile(depth[camera], [2, 98]) if camera.any() else (0.0, 1.0)
    share = np.nan_to_num((depth - low) / max(float(high - low), 1e-6)).clip(0, 1)
    picture = (255 * colormaps["viridis"](1 - share)[..., :3]).astype(np.uint8)
    picture[arrays["shadow"]] = SHADOW
    picture[~camera] = UNSEEN
    picture[grid_lines(arrays[contents.PHASE]) & arrays["visible"]] = LINE
    return _resized(picture, sample)


def grid_lines(phase: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Tell which pixels (H, W) are nearest to where a phase (H, W, 2) passes through zero."""
    lines = np.zeros(phase.shape[:2], bool)
    for part in np.moveaxis(phase, -1, 0):
        for axis in (0, 1):
            first, second = (np.take(part, np.arange(a, part.shape[axis] - 1 + a), axis)
                             for a in (0, 1))  # fmt: skip
            # A jump by a whole turn is the wrap half-way between two lines.
            crossed = (first * second <= 0) & (np.abs(first - second) < np.pi)
            nearer = np.abs(first) <= np.abs(second)
            before, after = [slice(None)] * 2, [slice(None)] * 2
            before[axis], after[axis] = slice(None, -1), slice(1, None)
            lines[tuple(before)] |= crossed & nearer
            lines[tuple(after)] |= crossed & ~nearer
    return lines


def _resized(image: Image, sample: Stored) -> Image:
    size = THUMB, _height(sample)
    interpolation = cv2.INTER_AREA if image.shape[1] > THUMB else cv2.INTER_NEAREST
    return np.asarray(
        cv2.resize(np.ascontiguousarray(image), size, interpolation=interpolation), np.uint8
    )
