"""Projection models: how a direction leaving the projector becomes a pattern coordinate.

A law maps the direction Y = R X + t to normalised pattern coordinates (a, b); the projector then
distorts, scales and shifts them: q = centre + focal (a', aspect b'). Adding a law is one class
with ``@register_projection_model`` and nothing else.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, namespace
from .brown_distortion import BrownDistortion


class ProjectionModel(Protocol):
    """What a projection model provides; formulas run on NumPy and Dr.Jit components alike."""

    name: ClassVar[str]

    def normalise(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        """Map a direction of any length, z > 0, to normalised pattern coordinates."""
        ...

    def direction(self, a: Array, b: Array) -> tuple[Array, Array, Array]:
        """Map normalised pattern coordinates to a direction; not finite outside the range."""
        ...

    def density(self, x: Array, y: Array, z: Array) -> Array:
        """Return |d(a, b) / d omega|, the area of normalised pattern per solid angle."""
        ...


PROJECTION_MODELS: dict[str, ProjectionModel] = {}


def register_projection_model(cls: type) -> type:
    """Class decorator that makes a law available under its ``name``."""
    PROJECTION_MODELS[cls.name] = cls()
    return cls


@register_projection_model
class Pinhole:
    """(a, b) = (Yx, Yy) / Yz: a lens, or a DOE whose design pre-compensates its distortion."""

    name: ClassVar[str] = "pinhole"

    def normalise(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        return x / z, y / z

    def direction(self, a: Array, b: Array) -> tuple[Array, Array, Array]:
        return a, b, 1 + 0 * a

    def density(self, x: Array, y: Array, z: Array) -> Array:
        cosine = z / namespace(x, y, z).sqrt(x * x + y * y + z * z)
        return 1 / (cosine * cosine * cosine)


@register_projection_model
class DirectionCosine:
    """(a, b) = (Yx, Yy) / |Y|: the grating equation, orders equally spaced in direction cosines."""

    name: ClassVar[str] = "direction_cosine"

    def normalise(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        length = namespace(x, y, z).sqrt(x * x + y * y + z * z)
        return x / length, y / length

    def direction(self, a: Array, b: Array) -> tuple[Array, Array, Array]:
        xp = namespace(a, b)
        rest = 1 - a * a - b * b
        inside = rest > 0
        # Selecting the argument first keeps the derivative finite on the unselected side.
        z = xp.sqrt(xp.where(inside, rest, 1.0))
        return a, b, xp.where(inside, z, float("nan"))

    def density(self, x: Array, y: Array, z: Array) -> Array:
        return z / namespace(x, y, z).sqrt(x * x + y * y + z * z)


@dataclass(frozen=True, eq=False)
class ProjectorModel:
    """Intrinsics of a projector: q = centre + focal (a', aspect b') with (a', b') distorted.

    Components may be floats or Dr.Jit scalars; :meth:`project_xyz` and :meth:`unproject_uv` are
    exact inverses, differentiable with respect to everything.
    """

    law: str
    """Name in :data:`PROJECTION_MODELS`."""
    focal: Array
    """Pattern pixels."""
    centre: tuple[Array, Array]
    """Pattern pixels, integer = pixel centre."""
    aspect: Array = 1.0
    """fy / fx."""
    distortion: BrownDistortion = field(default_factory=BrownDistortion)
    """Acts on the law's normalised coordinates."""

    def with_(self, **changes: object) -> "ProjectorModel":
        """Return a copy with some fields replaced."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def project_xyz(self, x: Array, y: Array, z: Array) -> tuple[Array, Array]:
        """Project directions in the projector frame (any length, z > 0) to q, pattern pixels."""
        a, b = self.distortion.apply(*PROJECTION_MODELS[self.law].normalise(x, y, z))
        return self.centre[0] + self.focal * a, self.centre[1] + self.focal * self.aspect * b

    def unproject_uv(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return directions (not unit length) in the projector frame for pattern coordinates.

        Outside the law's range (evanescent orders of ``direction_cosine``) they are NaN.
        """
        a = (u - self.centre[0]) / self.focal
        b = (v - self.centre[1]) / (self.focal * self.aspect)
        return PROJECTION_MODELS[self.law].direction(*self.distortion.remove(a, b))

    def density_xyz(self, x: Array, y: Array, z: Array) -> Array:
        """Return |dq / d omega|, pattern pixels per steradian, at directions of any length."""
        law = PROJECTION_MODELS[self.law]
        jxx, jxy, jyy = self.distortion.jacobian(*law.normalise(x, y, z))
        stretch = namespace(jxx).abs(jxx * jyy - jxy * jxy)
        return self.focal * self.focal * self.aspect * stretch * law.density(x, y, z)

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Project NumPy points (..., 3) of the projector frame to q (..., 2); NaN behind it."""
        x, y, z = np.moveaxis(points, -1, 0)
        front = z > 0
        u, v = self.project_xyz(x, y, np.where(front, z, 1.0))
        return np.where(front[..., None], np.stack([u, v], -1), np.nan)

    def unproject(self, q: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return NumPy unit directions (..., 3) for q (..., 2); NaN outside the law's range."""
        with np.errstate(invalid="ignore", over="ignore"):
            d = np.stack(self.unproject_uv(q[..., 0], q[..., 1]), -1)
            return d / np.linalg.norm(d, axis=-1, keepdims=True)


def projector_model(
    law: str,
    focal: Array,
    centre: Sequence[Array],
    aspect: Array = 1.0,
    distortion: Sequence[Array] = (),
) -> ProjectorModel:
    """Build a :class:`ProjectorModel` from plain values (distortion in OpenCV order)."""
    return ProjectorModel(law, focal, (centre[0], centre[1]), aspect, BrownDistortion(distortion))
