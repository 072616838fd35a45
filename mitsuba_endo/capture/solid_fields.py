"""Endless random fields in space, from which vessels and fine relief are made.

Sums of plane waves (Fourier noise): smooth, with exact gradients, and the same on every mesh,
because they depend on the position alone (solid texturing, Perlin 1985). Wave vectors are fixed;
a seed only turns and shifts the tissue within the field, so that Dr.Jit compiles the field once
for all seeds. Formulas run on NumPy and Dr.Jit components alike.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.arrays import Array, namespace
from ..geometry.transforms import RigidTransform

_WAVES = 8
"""Plane waves in a sum: by then its values are nearly normal, and each more costs a sine."""
_CELLS = 3
"""Fields that compete in a network; fewer would give closed curves, more cost more."""
_SHIFT_MM = 1000.0
"""Largest shift along an axis, mm: a hundred times the longest wave, so that seeds differ."""

Vector = tuple[Array, Array, Array]


def field_from_tissue(seed: int) -> RigidTransform:
    """Return where in the field the tissue of a seed lies, mm."""
    rng = np.random.default_rng(seed)
    R = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    return RigidTransform(R, rng.uniform(-_SHIFT_MM, _SHIFT_MM, 3))


def waves(p: Sequence[Array], wavelength: float, family: int) -> tuple[Array, Vector]:
    """Return a field of unit variance and its gradient (per mm) at p = (x, y, z), mm.

    Args:
        p: components in the field's frame.
        wavelength: mean one, mm; they spread by a quarter.
        family: which of the independent fields.
    """
    xp = namespace(*p)
    total, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for (kx, ky, kz), phase in _spectrum(family):
        a, b, c = (k / wavelength for k in (kx, ky, kz))
        angle = a * p[0] + b * p[1] + c * p[2] + phase
        total, slope = total + xp.cos(angle), xp.sin(angle)
        gx, gy, gz = gx - a * slope, gy - b * slope, gz - c * slope
    scale = float(np.sqrt(2 / _WAVES))
    return scale * total, (scale * gx, scale * gy, scale * gz)


def network_distance(p: Sequence[Array], wavelength: float, family: int) -> Array:
    """Return the distance, mm, to a network of curved walls that branch in threes.

    The walls are where the two highest of several fields are equal; to first order the distance
    is their difference over the length of its gradient.
    """
    xp = namespace(*p)
    fields = [waves(p, wavelength, _CELLS * family + k) for k in range(_CELLS)]
    first, second = fields[0], fields[1]
    swap = second[0] > first[0]
    first, second = _either(xp, swap, second, first), _either(xp, swap, first, second)
    for other in fields[2:]:
        leads, follows = other[0] > first[0], other[0] > second[0]
        second = _either(xp, leads, first, _either(xp, follows, other, second))
        first = _either(xp, leads, other, first)
    gap = first[0] - second[0]
    squared = sum((a - b) * (a - b) for a, b in zip(first[1], second[1], strict=True))
    return gap / xp.sqrt(squared + (0.3 / wavelength) ** 2)


def _either(
    xp: Any, condition: Array, a: tuple[Array, Vector], b: tuple[Array, Vector]
) -> tuple[Array, Vector]:
    x, y, z = (xp.where(condition, i, j) for i, j in zip(a[1], b[1], strict=True))
    return xp.where(condition, a[0], b[0]), (x, y, z)


@cache
def _spectrum(family: int) -> list[tuple[tuple[float, float, float], float]]:
    """Return wave vectors (radians per wavelength) and phases of one field."""
    rng = np.random.default_rng([20, family])
    direction = rng.normal(size=(_WAVES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    number = 2 * np.pi / rng.uniform(0.75, 1.25, _WAVES)
    phase = rng.uniform(0, 2 * np.pi, _WAVES)
    vectors = (number[:, None] * direction).tolist()
    return [((x, y, z), float(f)) for (x, y, z), f in zip(vectors, phase, strict=True)]
