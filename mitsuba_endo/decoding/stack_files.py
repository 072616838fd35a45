"""Stacks on disk: ``NN_LABEL.png``, numbered in the order of projection."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_folder
from ..folder_mark import Kind as FolderKind
from ..png import write_png
from ..reading.regular import is_file
from .image_files import (
    VIDEOS,
    ImageSource,
    depth_scale,
    images_in,
    images_of,
    open_image,
    read_image,
)
from .stack_images import Stack
from .stack_patterns import patterns
from .stack_plan import STRIPES, Kind, StackPlan

_LABEL = re.compile(r"(?:[xy]_(?:gray\d+(?:_inverse)?|phase[\d.]+_step\d+)|white|black)$")
MEMORY = 150_000_000
"""Bytes of raw images that are held at once: of larger stacks, rows are read again."""


def save_patterns(folder: str | Path, plan: StackPlan) -> list[str]:
    """Write the images to project as 8-bit PNG and return their names in order.

    Raises:
        InputError: the folder holds other files or cannot be written.
    """
    labels = plan.labels()
    digits = len(str(len(labels) - 1))
    names = [f"{i:0{digits}d}_{label}.png" for i, label in enumerate(labels)]
    with atomic_folder(folder, FolderKind.PATTERNS) as aside:
        for name, image in zip(names, patterns(plan), strict=True):
            write_png(aside / name, image)
    return names


def stack_paths(given: Sequence[str | Path]) -> list[ImageSource]:
    """Return the images: those given, or those of the one folder or file of pages given.

    Those of a folder come by number and name.

    Raises:
        InputError: a file is missing, or the folder holds no image.
    """
    paths = [Path(p) for p in given]
    if len(paths) == 1 and paths[0].is_dir():
        return list(images_of(paths[0]))
    for path in paths:
        if not is_file(path):
            raise InputError("no such image", str(path), "give image files or one folder")
        if path.suffix.lower() in VIDEOS:
            raise InputError("is a video", str(path), "save an image of each pattern")
    return list(images_in(paths[0])) if len(paths) == 1 else list(paths)


def check_names(paths: Sequence[ImageSource], plan: StackPlan) -> None:
    """Compare the number of files, and names that end in a label, with the plan.

    Raises:
        InputError: images are missing, too many or in another order.
    """
    labels = plan.labels()
    labels_named = [_label(path) for path in paths]
    missing = [label for label in labels if label not in labels_named]
    if None not in labels_named and missing:
        raise InputError(f"the image of {missing[0]} is missing", "stack", "add it")
    if len(paths) != len(labels):
        raise InputError(
            f"{len(paths)} images, but this pattern has {len(labels)}", "stack",
            f"give {_abridged(labels)}",
        )  # fmt: skip
    for path, label, name in zip(paths, labels, labels_named, strict=True):
        if name is not None and name != label:
            raise InputError(
                f"stands where {label} is expected", str(path), "put the images in order"
            )


def _label(path: ImageSource) -> str | None:
    match = _LABEL.search(path.stem)
    return match.group() if match else None


def _abridged(labels: Sequence[str]) -> str:
    shown = labels if len(labels) <= 6 else [*labels[:4], "...", labels[-1]]
    return ", ".join(shown)


def labels_of(paths: Sequence[ImageSource]) -> list[str] | None:
    """Return the labels that names end in; None unless all do."""
    labels = [_label(path) for path in paths]
    return None if None in labels else [label for label in labels if label]


def labelled_plan(
    labels: Sequence[str],
    kind: Kind | None,
    width: int,
    height: int,
    stripe: float | None,
    stated: dict[str, Any],
) -> StackPlan:
    """Return the plan that labels tell of, and what is stated otherwise.

    Args:
        labels: of all images.
        kind: None: as the labels say.
        width: of the pattern, pixels.
        height: of the pattern, pixels.
        stripe: narrowest one; None: the usual one with as many bits.
        stated: further arguments of :meth:`StackPlan.make`; None: as the labels say.

    Raises:
        InputError: there is no such plan.
    """
    bits = {label for label in labels if re.fullmatch(r"x_gray\d+", label)}
    waves = [m for m in (re.fullmatch(r"x_phase([\d.]+)_step(\d+)", la) for la in labels) if m]
    periods = tuple(sorted({float(m[1]) for m in waves}, reverse=True))
    told: Kind = "gray+phase" if bits and waves else "phase" if waves else "gray"
    fill = {
        "reference": "white" in labels or "black" in labels,
        "inverse": any(label.endswith("_inverse") for label in labels),
        "periods": periods or None,
        "steps": max(int(m[2]) for m in waves) + 1 if waves else None,
    }
    fill |= {name: value for name, value in stated.items() if value is not None}
    tried = [stripe] if stripe is not None or not bits else [None, *STRIPES]
    plans = []
    for width_of_stripe in tried:
        try:
            plans.append(
                StackPlan.make(kind or told, width, height, stripe=width_of_stripe, **fill)
            )
        except InputError:
            if width_of_stripe == tried[0]:
                raise
    return next((plan for plan in plans if plan.bits("x") == len(bits)), plans[0])


class StackFiles:
    """Images of a stack on disk: 8 or 16 bits, colour or gray.

    They hold linear brightness to the power 1 / ``gamma``. Phases need linear brightness: gamma
    2.2 unnoticed shifts them by some hundredths of a period. Full scale of 16-bit files is the
    smallest of 10, 12, 14 and 16 bits that holds them all.
    """

    def __init__(
        self, paths: Sequence[ImageSource], gamma: float = 1.0, memory: int = MEMORY,
        advance: Callable[[float], None] = lambda share: None,
    ) -> None:  # fmt: skip
        """Look at every image once.

        Args:
            paths: of the images.
            gamma: of all of them.
            memory: bytes of raw images to hold at once.
            advance: called with the share that is done.

        Raises:
            InputError: an image is missing, damaged, of another kind or of another size.
        """
        self._paths, self._gamma, self._memory = list(paths), gamma, memory
        first = read_image(self._paths[0])
        self._band = _Band(0, {})
        brightest, keep = 0, first.nbytes * len(self._paths) <= memory
        self.notes: list[str] = []
        """What was done to the images that their reader should know, sentences."""
        for k, path in enumerate(self._paths):
            stored = open_image(path)
            raw = stored.pixels
            self.notes += [stored.note] if stored.note else []
            _check_alike(raw, first, path)
            brightest = max(brightest, int(raw.max()))
            if keep:
                self._band.rows[k] = raw
            advance((k + 1) / len(self._paths))
        self.shape: tuple[int, int] = (first.shape[0], first.shape[1])
        self.levels = depth_scale(brightest, first.dtype)
        self._row_bytes = first[:1].nbytes

    def __len__(self) -> int:
        return len(self._paths)

    def rows(self, which: Sequence[int], start: int, stop: int) -> Stack:
        """Return rows ``start`` to ``stop`` of some images."""
        if not self._band.holds(which, start, stop):
            high = start + max(stop - start, self._memory // (self._row_bytes * len(which)))
            self._band = _Band(start, {k: self._read(k, start, high) for k in which})
        return self._stack([self._band.of(k, start, stop) for k in which])

    def windows(self, spans: Sequence[tuple[int, int]]) -> Iterator[list[Stack]]:
        """Yield each image's rows in several spans: one reading of the files for all."""
        for k in range(len(self)):
            held = self._band.holds([k], 0, self.shape[0])
            raw = self._band.of(k, 0, self.shape[0]) if held else read_image(self._paths[k])
            yield [self._stack([raw[start:stop]]) for start, stop in spans]

    def _read(self, image: int, start: int, stop: int) -> NDArray[np.integer]:
        return read_image(self._paths[image])[start:stop].copy()

    def _stack(self, raw: Sequence[NDArray[np.integer]]) -> Stack:
        levels = self.levels
        light = [(rows / np.float32(levels)).mean(-1, dtype=np.float32) for rows in raw]
        full = np.stack([(rows >= levels).any(-1) for rows in raw])
        # Left alone, gamma 1 keeps every value.
        images = np.stack(light) if self._gamma == 1 else np.stack(light) ** self._gamma
        return Stack(images.astype(np.float32, copy=False), full, levels)


@dataclass(frozen=True, eq=False)
class _Band:
    """Rows of some images in memory."""

    start: int
    rows: dict[int, NDArray[np.integer]]

    def holds(self, which: Sequence[int], start: int, stop: int) -> bool:
        inside = start >= self.start and all(k in self.rows for k in which)
        return inside and all(stop <= self.start + len(self.rows[k]) for k in which)

    def of(self, image: int, start: int, stop: int) -> NDArray[np.integer]:
        return self.rows[image][start - self.start : stop - self.start]


def _check_alike(raw: NDArray[np.integer], first: NDArray[np.integer], path: ImageSource) -> None:
    if raw.shape[:2] != first.shape[:2]:
        raise InputError(
            f"is {raw.shape[1]} x {raw.shape[0]} pixels, the first image "
            f"{first.shape[1]} x {first.shape[0]}", str(path), "give images of one size",
        )  # fmt: skip
    if raw.dtype != first.dtype:
        raise InputError(
            f"is {raw.dtype}, the first image {first.dtype}", str(path), "give one kind"
        )
