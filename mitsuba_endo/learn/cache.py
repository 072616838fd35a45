"""Views on disk: made once, mapped into memory by every process that trains."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..files import atomic_folder
from ..folder_mark import Kind
from .scenes import random_endoscope, random_kind, random_surface
from .views import SUPERSAMPLE, UNLIT, View, make_view

if TYPE_CHECKING:
    from ..rendering.synthetic import MeshScene

MINIMUM_LIT = 0.25
"""Share of the samples that the projector must reach; views with less are drawn again."""
TRIES = 20
"""Endoscopes drawn before the last one is taken as it is."""


@dataclass(frozen=True)
class CacheSettings:
    """What makes a cache; equal settings give equal caches."""

    views: int = 640
    width: int = 320
    height: int = 240
    per_surface: int = 6
    """Views of each surface."""
    seed: int = 0


@dataclass(frozen=True, eq=False)
class ViewCache:
    """Views as memory-mapped arrays, one more leading axis than in :class:`View`."""

    lattice: NDArray[np.int16]
    shading: NDArray[np.float16]
    flags: NDArray[np.uint8]
    kinds: list[str]

    def __len__(self) -> int:
        return len(self.kinds)

    def view(self, index: int) -> View:
        return View(self.lattice[index], self.shading[index], self.flags[index])


def open_cache(
    folder: Path, settings: CacheSettings, tick: Callable[[int], None] = lambda done: None
) -> ViewCache:
    """Map the views of ``folder``; make them first if they are not there.

    Args:
        folder: of the cache, replaced if it was made by other settings.
        settings: number and size of the views, and the seed.
        tick: called with the number of views made so far.

    Raises:
        InputError: the folder holds other files or cannot be written.
    """
    stamp = folder / "settings.json"
    if not stamp.is_file() or json.loads(stamp.read_text())["settings"] != asdict(settings):
        with atomic_folder(folder, Kind.VIEWS) as aside:
            kinds = _fill(aside, settings, tick)
            text = json.dumps({"settings": asdict(settings), "kinds": kinds}, indent=1)
            (aside / "settings.json").write_text(text)
    kinds = json.loads(stamp.read_text())["kinds"]
    arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r") for name in _shapes(settings)}
    return ViewCache(arrays["lattice"], arrays["shading"], arrays["flags"], kinds)


def _shapes(settings: CacheSettings) -> dict[str, tuple[type, tuple[int, ...]]]:
    n, h, w, s = settings.views, settings.height, settings.width, SUPERSAMPLE
    return {
        "lattice": (np.int16, (n, s * h, s * w, 2)),
        "shading": (np.float16, (n, h, w, 4)),
        "flags": (np.uint8, (n, h, w)),
    }


def _fill(folder: Path, settings: CacheSettings, tick: Callable[[int], None]) -> list[str]:
    from .. import backend

    backend.ensure()
    from ..rendering.synthetic import MeshScene

    arrays = {
        name: np.lib.format.open_memmap(folder / f"{name}.npy", "w+", dtype, shape)
        for name, (dtype, shape) in _shapes(settings).items()
    }
    kinds: list[str] = []
    while len(kinds) < settings.views:
        rng = np.random.default_rng((settings.seed, len(kinds)))
        kind = random_kind(rng)
        mesh = random_surface(kind, rng)
        scene = MeshScene(mesh.vertices, mesh.faces)
        for _ in range(min(settings.per_surface, settings.views - len(kinds))):
            view = _lit_view(scene, kind, settings, rng)
            for name, array in arrays.items():
                array[len(kinds)] = getattr(view, name)
            kinds.append(kind)
            tick(len(kinds))
    for array in arrays.values():
        array.flush()
    return kinds


def _lit_view(
    scene: "MeshScene", kind: str, settings: CacheSettings, rng: np.random.Generator
) -> View:
    """Draw endoscopes until the projector reaches enough of what the camera sees."""
    view = None
    for _ in range(TRIES):
        endoscope = random_endoscope(kind, (settings.width, settings.height), SUPERSAMPLE, rng)
        view = make_view(scene, endoscope)
        if (view.lattice[..., 0] != UNLIT).mean() > MINIMUM_LIT:
            break
    assert view is not None
    return view
