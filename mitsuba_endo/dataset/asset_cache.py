"""What many samples share and takes long to make: patterns, the rabbit, the user's surfaces.

Each is made once for a dataset, by whichever process needs it first, and kept in a folder.
"""

import contextlib
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..decoding.grid_pattern import COLOURS, CodedGrid
from ..files import atomic_path
from ..litter import sweep
from ..shapes import Mesh, make_shape
from .config import Config
from .streams import stream

FIGURE = "rabbit"
"""Kind of scene whose mesh takes seconds to make."""
FIGURE_HEIGHT, FIGURE_EDGE = 60.0, 1.0
"""With which it is made, mm: edges of a sixtieth of its height, whatever height is drawn."""
KEPT = 16
"""Patterns held in memory by a process."""


class AssetCache:
    """Ready-made parts of a dataset's samples."""

    def __init__(self, config: Config, folder: str | Path) -> None:
        self._config, self._folder = config, Path(folder)
        self._grid = lru_cache(self._draw_grid)
        self._texture = lru_cache(KEPT)(self._load_texture)
        self._mesh = lru_cache(self._load_mesh)

    def grid(self, variant: int) -> CodedGrid:
        """Return the pattern of this number.

        Raises:
            InputError: no code exists for the drawn numbers of lines.
        """
        return self._grid(variant)

    def pattern(self, variant: int) -> NDArray[np.float32]:
        """Return the linear RGB image (H, W, 3) of the pattern of this number."""
        colour = np.array(COLOURS[self.grid(variant).colour], np.float32)
        return self._texture(variant)[..., None] * colour

    def figure(self) -> Mesh:
        """Return the rabbit one mm high, around the origin and looking along -z."""
        path = self._folder / "rabbit.npz"
        if not path.exists():
            mesh = make_shape(FIGURE, height=FIGURE_HEIGHT, distance=1.0, yaw=0.0, edge=FIGURE_EDGE)
            save_mesh(path, Mesh((mesh.vertices - [0, 0, 1.0]) / FIGURE_HEIGHT, mesh.faces))
        return self._mesh(path)

    def user_mesh(self, scene: int) -> Mesh:
        """Return the user's surface of the configuration's scene of this number."""
        return self._mesh(user_mesh_path(self._folder, scene))

    def _draw_grid(self, variant: int) -> CodedGrid:
        ranges, rng = self._config.pattern, stream(self._config.seed, "pattern", variant)
        return CodedGrid(
            width=ranges.width,
            height=ranges.height,
            columns=ranges.columns.draw(rng),
            rows=ranges.rows.draw(rng),
            period=ranges.period.draw(rng),
            line=ranges.line.draw(rng),
            step=ranges.step.draw(rng),
            seed=ranges.codes.draw(rng),
            background=ranges.background.draw(rng),
            zero_order=ranges.zero_order.draw(rng),
            zero_order_size=ranges.zero_order_size.draw(rng),
            colour=ranges.colour.draw(rng),
            oversample=ranges.oversample,
        )

    def _load_texture(self, variant: int) -> NDArray[np.float32]:
        path = self._folder / f"pattern{variant:05d}.npy"
        if not path.exists():
            grid = self.grid(variant)
            image = grid.texture(grid.width * grid.oversample, grid.height * grid.oversample)
            with atomic_path(path) as aside, aside.open("wb") as file:
                np.save(file, image)
        return np.load(path)

    def _load_mesh(self, path: Path) -> Mesh:
        with np.load(path) as data:
            return Mesh(data["vertices"], data["faces"])


def user_mesh_path(folder: str | Path, scene: int) -> Path:
    """Return where the surface of a scene of kind ``file`` is kept."""
    return Path(folder) / f"surface{scene:03d}.npz"


def clear_assets(folder: Path) -> None:
    """Remove what was kept here, and the folder unless somebody put other files into it."""
    sweep(folder, alone=True)
    for name in ("rabbit.npz", "pattern?????.npy", "surface???.npz"):
        for path in folder.glob(name):
            path.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        folder.rmdir()


def save_mesh(path: Path, mesh: Mesh) -> None:
    """Keep a mesh without loss.

    Raises:
        InputError: the folder cannot be written.
    """
    with atomic_path(path) as aside, aside.open("wb") as file:
        np.savez(file, vertices=mesh.vertices, faces=mesh.faces)
