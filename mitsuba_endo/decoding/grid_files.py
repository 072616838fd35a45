"""The coded grid as files: pictures to project, a drawing for a mask maker, and its code."""

import json
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..files import atomic_folder, atomic_path
from ..folder_mark import Kind
from ..png import write_png
from .grid_pattern import CodedGrid

PNG, TIFF, SVG, JSON = "coded.png", "coded.tiff", "coded.svg", "coded.json"
_FULL = {8: np.uint8, 16: np.uint16}
"""Type of a pixel by its bits."""
_FWHM = 2 * float(np.sqrt(2 * np.log(2)))
"""Width of a Gaussian at half its height over its standard deviation."""


def save_grid(folder: str | Path, grid: CodedGrid) -> list[str]:
    """Write the pattern for a projector, a mask maker and a program; return the files' names.

    ==========  ================================================================================
    coded.png   8 bits, linear, ``oversample`` pixels a pattern pixel
    coded.tiff  the same in 16 bits
    coded.svg   the lines as strokes as wide as they are at half their height; a unit of the
                drawing is a pattern pixel, whose pixel (0, 0) is centred at (0.5, 0.5)
    coded.json  the settings, the description that ``--pattern`` takes, the code
                (1, 0, -1: the line's right part is higher, level, lower) and the nodes'
                coordinates
    ==========  ================================================================================

    Raises:
        InputError: the folder holds other files or cannot be written, or no code of that size was
            found.
    """
    light = grid.texture(grid.width * grid.oversample, grid.height * grid.oversample)
    with atomic_folder(folder, Kind.PATTERNS) as aside:
        write_png(aside / PNG, _integers(light, 8))
        _write_tiff(aside / TIFF, _integers(light, 16))
        for name, text in ((SVG, drawing(grid)), (JSON, json.dumps(description(grid), indent=1))):
            with atomic_path(aside / name) as part:
                part.write_text(text + "\n", encoding="utf-8")
    return [PNG, TIFF, SVG, JSON]


def description(grid: CodedGrid) -> dict[str, Any]:
    """Return what a program needs to know of a grid; coordinates are pattern pixels."""
    changed = [
        f"{f.name}={getattr(grid, f.name)}"
        for f in fields(grid)
        if f.name not in ("width", "height") and getattr(grid, f.name) != f.default
    ]
    return {
        "pattern": "pattern:coded" + ("?" + "&".join(changed) if changed else ""),
        **asdict(grid),
        "code": grid.code.tolist(),
        "nodes": np.round(grid.nodes, 6).tolist(),
    }


def drawing(grid: CodedGrid) -> str:
    """Return the grid as SVG: light strokes on black."""
    stroke = _FWHM * grid.line * grid.period
    lines = " ".join(
        "M" + "L".join(f"{x + 0.5:.4f},{y + 0.5:.4f}" for x, y in ends) for ends in segments(grid)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{grid.width}" height="{grid.height}" '
        f'viewBox="0 0 {grid.width} {grid.height}">\n'
        f'<rect width="{grid.width}" height="{grid.height}" fill="black"/>\n'
        f'<path d="{lines}" stroke="white" stroke-width="{stroke:.4f}" fill="none"/>\n</svg>'
    )


def segments(grid: CodedGrid) -> NDArray[np.float64]:
    """Return the middles of the grid's lines as (N, 2, 2) ends, pattern pixels."""
    columns, rows = np.arange(grid.columns), np.arange(grid.rows)
    low, high = np.full(grid.columns, -0.5), np.full(grid.columns, grid.rows - 0.5)
    upright = np.stack([np.stack([columns, low], -1), np.stack([columns, high], -1)], 1)
    left, row = (a.ravel() for a in np.meshgrid(np.arange(-1, grid.columns), rows))
    code = np.pad(grid.code, ((0, 0), (1, 1)))
    start, end = code[row, left + 1], code[row, left + 2]
    ends = [
        np.stack([u, row - grid.step / 2 * (start - (start + end) * (u - left))], -1)
        for u in (np.maximum(left, -0.5), np.minimum(left + 1, grid.columns - 0.5))
    ]
    return grid.pixels(np.concatenate([upright, np.stack(ends, 1)]).astype(np.float64))


def _integers(light: NDArray[np.float32], bits: int) -> NDArray[Any]:
    """Return brightness in whole numbers, the brightest at full scale."""
    full = 2**bits - 1
    return np.round(full * light / light.max()).astype(_FULL[bits])


def _write_tiff(path: Path, image: NDArray[Any]) -> None:
    _, data = cv2.imencode(".tiff", image)
    with atomic_path(path) as aside:
        aside.write_bytes(data.tobytes())
