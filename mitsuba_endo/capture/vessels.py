"""Blood vessels under the mucosa, as a field in space."""

from collections.abc import Sequence

from ..geometry.arrays import Array, namespace
from .solid_fields import network_distance, waves

ABSORPTION = (0.25, 1.0, 0.85)
"""Of a vessel's middle in red, green and blue, relative: haemoglobin lets red pass."""


def vessel_density(p: Sequence[Array], scale: float | Array) -> Array:
    """Return how much of a vessel there is at p = (x, y, z): 0 beside, 1 in a large one's middle.

    Two branching networks, large vessels about ``scale`` (mm) apart and fine ones, wind, swell
    and fade out along their way.

    Args:
        p: components in the field's frame, mm.
        scale: mean distance of the larger vessels, mm.
    """
    xp = namespace(*p)
    wind = [waves(p, 1.0 * scale, 40 + axis)[0] for axis in range(3)]
    q = [x + 0.09 * scale * w for x, w in zip(p, wind, strict=True)]
    swell = waves(p, 3.1 * scale, 50)[0]
    width = scale * (0.035 + 0.02 * _clip(xp, 1 + swell))
    large = _bell(network_distance(q, 3.2 * scale, 0) / width)
    fine = _bell(network_distance(q, 1.25 * scale, 1) / (scale * 0.03))
    return xp.maximum(
        large * xp.minimum(_clip(xp, 0.75 + 0.5 * swell), 1.0),
        0.55 * fine * xp.minimum(_clip(xp, 0.6 - 0.6 * swell), 1.0),
    )


def _bell(x: Array) -> Array:
    """Return 1 / (1 + x^2 / 4)^4, close to exp(-x^2 / 2) inwards and the same on Dr.Jit."""
    y = 1 + 0.25 * x * x
    y = y * y
    return 1 / (y * y)


def _clip(xp: object, x: Array) -> Array:
    return xp.maximum(x, 0.0)  # pyright: ignore[reportAttributeAccessIssue]
