"""Camera models by name, and what each of them can do."""

from collections.abc import Sequence
from typing import ClassVar, Protocol

from ..arrays import Array


class CameraLaw(Protocol):
    """Maps directions to normalised image coordinates and back."""

    name: ClassVar[str]
    max_coefficients: ClassVar[tuple[int, ...]]
    """Numbers of coefficients that a file may give."""
    coefficients: ClassVar[tuple[str, ...]]
    """Their names, in the order of files; scenes give them by name."""

    def normalise(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]: ...

    def direction(
        self, coefficients: Sequence[Array], a: Array, b: Array
    ) -> tuple[Array, Array, Array]: ...

    def density(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> tuple[Array, Array]:
        """Return |d(a, b) / d omega| and a mask: on the branch that ``direction`` inverts."""
        ...

    def projectable(
        self, coefficients: Sequence[Array], x: Array, y: Array, z: Array
    ) -> Array | bool:
        """Return a mask of directions for which ``normalise`` has a finite value."""
        ...

    def reach(self, coefficients: Sequence[Array], angle: float) -> float:
        """Return how far from the centre, normalised, a direction at this angle (radians) is seen.

        Models with distortion after the projection leave it out.
        """
        ...


CAMERAS: dict[str, CameraLaw] = {}
"""Every camera model, by the name that rig files and scenes use."""

MIN_COSINE = 0.01
"""Directions beyond 89.4 degrees would overflow the polynomials of a lens of this kind."""


def register_camera(cls: type) -> type:
    """Class decorator that makes a camera model available under its ``name``."""
    CAMERAS[cls.name] = cls()
    return cls
