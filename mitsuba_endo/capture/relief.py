"""Fine relief of a wet surface, too fine for a mesh: it breaks up reflections."""

from collections.abc import Sequence

import numpy as np

from ..geometry.arrays import Array
from .solid_fields import Vector, waves

_OCTAVES = ((1.6, 0.8, 60), (0.6, 0.6, 61))
"""Wavelength in mm, share of the slope (squares sum to 1), family of the field."""


def relief(p: Sequence[Array]) -> tuple[Array, Vector]:
    """Return the height, mm, and its gradient at p = (x, y, z), mm, for a slope of 1.

    The slope is the root mean square of the height's gradient along a surface: a gradient in
    space has two thirds of its square there.
    """
    height, gradient = 0.0, [0.0, 0.0, 0.0]
    for wavelength, share, family in _OCTAVES:
        field, slope = waves(p, wavelength, family)
        h = float(share * wavelength / (2 * np.pi) * np.sqrt(3 / 2))
        height = height + h * field
        gradient = [g + h * s for g, s in zip(gradient, slope, strict=True)]
    return height, (gradient[0], gradient[1], gradient[2])
