"""Stacks on disk: ``NN_LABEL.png``, numbered in the order of projection."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import atomic_folder
from ..folder_mark import Kind
from ..png import write_png
from ..reading.regular import is_file
from .image_files import full_scale, images_of, read_image
from .plan import StackPlan
from .stack import Stack, patterns

_LABEL = re.compile(r"(?:[xy]_(?:gray\d+(?:_inverse)?|phase[\d.]+_step\d+)|white|black)$")


def save_patterns(folder: str | Path, plan: StackPlan) -> list[str]:
    """Write the images to project as 8-bit PNG and return their names in order.

    Raises:
        InputError: the folder holds other files or cannot be written.
    """
    labels = plan.labels()
    digits = len(str(len(labels) - 1))
    names = [f"{i:0{digits}d}_{label}.png" for i, label in enumerate(labels)]
    with atomic_folder(folder, Kind.PATTERNS) as aside:
        for name, image in zip(names, patterns(plan), strict=True):
            write_png(aside / name, image)
    return names


def stack_paths(given: Sequence[str | Path]) -> list[Path]:
    """Return the images: those given, or those of the one folder given, by number and name.

    Raises:
        InputError: a file is missing, or the folder holds no image.
    """
    paths = [Path(p) for p in given]
    if len(paths) == 1 and paths[0].is_dir():
        return images_of(paths[0])
    for path in paths:
        if not is_file(path):
            raise InputError("no such image", str(path), "give image files or one folder")
    return paths


def check_names(paths: Sequence[Path], plan: StackPlan) -> None:
    """Compare the number of files, and names that end in a label, with the plan.

    Raises:
        InputError: images are missing, too many or in another order.
    """
    labels = plan.labels()
    found = [_label(path) for path in paths]
    missing = [label for label in labels if label not in found]
    if None not in found and missing:
        raise InputError(f"the image of {missing[0]} is missing", "stack", "add it")
    if len(paths) != len(labels):
        raise InputError(
            f"{len(paths)} images, but this pattern has {len(labels)}", "stack",
            f"give {_abridged(labels)}",
        )  # fmt: skip
    for path, label, name in zip(paths, labels, found, strict=True):
        if name is not None and name != label:
            raise InputError(
                f"stands where {label} is expected", str(path), "put the images in order"
            )


def _label(path: Path) -> str | None:
    match = _LABEL.search(path.stem)
    return match.group() if match else None


def _abridged(labels: Sequence[str]) -> str:
    shown = labels if len(labels) <= 6 else [*labels[:4], "...", labels[-1]]
    return ", ".join(shown)


def load_stack(paths: Sequence[str | Path], gamma: float = 1.0) -> Stack:
    """Read 8- or 16-bit images, colour or gray, of linear brightness to the power 1 / ``gamma``.

    Phases need linear brightness: gamma 2.2 unnoticed shifts them by some hundredths of a period.
    Full scale of 16-bit files is the smallest of 10, 12, 14 and 16 bits that holds them all.

    Raises:
        InputError: an image is missing, damaged, of another kind or of another size.
    """
    raw = [read_image(Path(path)) for path in paths]
    first = raw[0]
    for path, image in zip(paths, raw, strict=True):
        if image.shape[:2] != first.shape[:2]:
            raise InputError(
                f"is {image.shape[1]} x {image.shape[0]} pixels, the first image "
                f"{first.shape[1]} x {first.shape[0]}",
                str(path), "give images of one size",
            )  # fmt: skip
        if image.dtype != first.dtype:
            raise InputError(
                f"is {image.dtype}, the first image {first.dtype}", str(path), "give one kind"
            )
    levels = full_scale(*raw)
    return Stack(
        images=np.stack(
            [(image / np.float32(levels)).mean(-1, dtype=np.float32) ** gamma for image in raw]
        ),
        saturated=np.stack([(image >= levels).any(-1) for image in raw]),
        levels=levels,
    )
