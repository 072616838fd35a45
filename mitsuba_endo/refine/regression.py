"""Local regression of an image on the warped pattern: one small linear system per cell.

Under each window the image is modelled as

    light = (a0 + ax x + ay y) T + b0 + bx x + by y + a0 (du Tu + dv Tv)

with T the pattern at the present coordinates, Tu and Tv its derivatives along the pattern's axes, x
and y the distance from the window's middle in camera pixels. This is the linear step of Lucas and
Kanade (Baker and Matthews, Lucas-Kanade 20 Years On, 2004) with a change of brightness that is
linear over the window.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from .cells import Image, mean
from .windows import Windows

ONE, T, TU, TV, LIGHT = range(5)
"""Fields of the model, and the image."""
COLUMNS = (
    (ONE, 0, 0), (ONE, 1, 0), (ONE, 0, 1), (T, 0, 0), (T, 1, 0), (T, 0, 1), (TU, 0, 0), (TV, 0, 0),
    (LIGHT, 0, 0),
)  # fmt: skip
"""Field and powers of x and y of each column; the image last. The displacement is eliminated last,
so that what is left of its rows is its information with gain and offset free."""
OFFSET, GAIN, SHIFT, IMAGE = 0, 3, 6, 8
"""First of :data:`COLUMNS` of each kind."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ridges:
    """Prior information, in the units of the normal matrix; what the image says little of stays."""

    slope: float
    """Of a change of offset by the gain itself, or of gain, over one pixel."""
    shift: float
    """Of a displacement by one pattern pixel."""


@dataclass(frozen=True, eq=False)
class WindowFit:
    """Solution of every cell's regression, (N,) or (N, ...)."""

    shift: Floats
    """(N, 2) du, dv, pattern pixels."""
    gain: Floats
    """a0, at least the floor that was given."""
    offset: Floats
    """b0."""
    information: Floats
    """(N, 3) of the displacement: uu, uv, vv, with gain and offset free, prior included."""
    prior: Floats
    """Part of the information's diagonal that the prior gave."""
    residual: Floats
    """Weighted sum of squares that the model leaves."""
    variation: Floats
    """Weighted sum of squares that offset and its slope alone leave."""
    weight: Floats
    """Sum of the weights."""


def normal_equations(
    windows: Windows, weight: Image, fields: list[Image]
) -> dict[tuple[int, int], Floats]:
    """Return the upper triangle of the normal matrix (N,) by columns, means over cells summed.

    Args:
        windows: around the cells.
        weight: (H, W) of each pixel, 0 = not to be used.
        fields: (H, W) T, Tu, Tv and the image.
    """
    values = [weight, *(weight * f for f in fields)]
    plain = [None, *fields]
    degree: dict[tuple[int, int], int] = {}
    pairs = list(combinations_with_replacement(range(len(COLUMNS)), 2))
    for i, j in pairs:
        pair = _fields(i, j)
        degree[pair] = max(degree.get(pair, 0), sum(COLUMNS[i][1:]) + sum(COLUMNS[j][1:]))
    groups: list[list[tuple[int, int]]] = [[p for p in degree if degree[p] == d] for d in range(3)]
    products = [[mean(_product(values[a], plain[b])) for a, b in group] for group in groups]
    moments = windows.moments(*products)
    out = {}
    for i, j in pairs:
        pair = _fields(i, j)
        group = degree[pair]
        x, y = COLUMNS[i][1] + COLUMNS[j][1], COLUMNS[i][2] + COLUMNS[j][2]
        out[i, j] = moments.of(group, groups[group].index(pair), x, y)
    return out


def _fields(i: int, j: int) -> tuple[int, int]:
    """Return the two fields of a pair of columns; a product with 1 is that of (field, 1)."""
    a, b = sorted((COLUMNS[i][0], COLUMNS[j][0]))
    return (b, ONE) if a == ONE else (a, b)


def _product(weighted: Image, field: Image | None) -> Image:
    return weighted if field is None else weighted * field


def solve(A: dict[tuple[int, int], Floats], ridges: Ridges, floor: float) -> WindowFit:
    """Solve every cell's regression by elimination, all cells at once.

    Args:
        A: as from :func:`normal_equations`; changed in place.
        ridges: prior information.
        floor: least gain; where the pattern cannot be seen, steps stay small.
    """
    weight = A[0, 0].copy()
    tiny = 1e-9 * (weight + weight.max(initial=0)) + 1e-30
    rough = np.maximum(_rough_gain(A, tiny), floor) ** 2
    for k in (1, 2, 4, 5):
        A[k, k] = A[k, k] + ridges.slope / rough
    prior = ridges.shift / rough
    for k in (SHIFT, SHIFT + 1):
        A[k, k] = A[k, k] + prior
    for k in (OFFSET, GAIN):
        A[k, k] = A[k, k] + tiny
    _eliminate(A, OFFSET, GAIN, tiny)
    variation = A[IMAGE, IMAGE].copy()
    _eliminate(A, GAIN, SHIFT, tiny)
    x = _substitute(A, tiny)
    uu, uv, vv = A[6, 6], A[6, 7], A[7, 7]
    gain = np.maximum(x[GAIN], floor)
    det = np.maximum(uu * vv - uv * uv, 1e-30)
    u, v = (vv * A[6, 8] - uv * A[7, 8]) / det, (uu * A[7, 8] - uv * A[6, 8]) / det
    explained = u * A[6, 8] + v * A[7, 8]
    return WindowFit(
        shift=np.stack([u, v], -1) / gain[:, None], gain=gain, offset=x[OFFSET],
        information=np.stack([uu, uv, vv], -1) * (gain**2)[:, None], prior=prior * gain**2,
        residual=np.maximum(A[IMAGE, IMAGE] - explained, 0), variation=variation, weight=weight,
    )  # fmt: skip


def _rough_gain(A: dict[tuple[int, int], Floats], tiny: Floats) -> Floats:
    """Return the slope of the image over the pattern with an even offset."""
    w = A[0, 0] + tiny
    spread = A[GAIN, GAIN] - A[0, GAIN] ** 2 / w
    return (A[GAIN, IMAGE] - A[0, GAIN] * A[0, IMAGE] / w) / np.maximum(spread, tiny)


def _eliminate(A: dict[tuple[int, int], Floats], first: int, end: int, tiny: Floats) -> None:
    """Subtract from later rows what columns ``first`` to ``end`` explain."""
    for k in range(first, end):
        pivot = np.maximum(A[k, k], tiny)
        for i in range(k + 1, IMAGE + 1):
            factor = A[k, i] / pivot
            for j in range(i, IMAGE + 1):
                A[i, j] = A[i, j] - factor * A[k, j]


def _substitute(A: dict[tuple[int, int], Floats], tiny: Floats) -> list[Floats]:
    """Return offset and gain with their slopes for no displacement, from the eliminated rows."""
    x: list[Floats] = [np.zeros(0)] * SHIFT
    for k in range(SHIFT - 1, -1, -1):
        rest = A[k, IMAGE]
        for j in range(k + 1, SHIFT):
            rest = rest - A[k, j] * x[j]
        x[k] = rest / np.maximum(A[k, k], tiny)
    return x
