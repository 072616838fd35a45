"""Working through large images by chunks of rows."""

from collections.abc import Iterator
from dataclasses import fields
from itertools import pairwise
from typing import Any

import numpy as np

CHUNK_VALUES = 12_000_000
"""Pixels of all images of a chunk together: an array of that size takes 48 MB."""


def row_chunks(shape: tuple[int, int], images: int, halo: int = 0) -> Iterator[tuple[int, int]]:
    """Yield first and last rows of chunks that hold so many images in little memory.

    Args:
        shape: rows and columns.
        images: held at once.
        halo: rows needed beyond each end.
    """
    height, width = shape
    most = max(1, CHUNK_VALUES // (images * width) - 2 * halo)
    edges = np.linspace(0, height, -(-height // most) + 1).astype(int).tolist()
    yield from pairwise(edges)


def inner_rows(part: Any, rows: slice) -> Any:
    """Return a record of arrays (rows, W) with some of their rows."""
    return type(part)(**{f.name: getattr(part, f.name)[rows] for f in fields(part)})


def with_rows(whole: Any, part: Any, start: int, height: int) -> Any:
    """Write the rows of a record of arrays into that of the whole image, made if it is None."""
    if whole is None:
        arrays = {f.name: getattr(part, f.name) for f in fields(part)}
        empty = {k: np.empty((height, *a.shape[1:]), a.dtype) for k, a in arrays.items()}
        whole = type(part)(**empty)
    for field in fields(part):
        values = getattr(part, field.name)
        getattr(whole, field.name)[start : start + len(values)] = values
    return whole
