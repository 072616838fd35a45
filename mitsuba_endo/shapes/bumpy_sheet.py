"""A bowl with ripples and one dent."""

import numpy as np
from numpy.typing import NDArray
from pydantic.dataclasses import dataclass

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes.grid import heightfield
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.registry import CHECKED, Finite, NonNegative, Positive, register


@register("bumpy_sheet")
@dataclass(frozen=True, kw_only=True, config=CHECKED)
class BumpySheet:
    """A sheet of gentle relief: a concave bowl, a ripple along each axis, and a dent.

    z(x, y) = distance - (radius - sqrt(radius^2 - x^2 - y^2))
            + ripple_depth * sin(x / ripple_x) * cos(y / ripple_y)
            + dent_depth * exp(-((x - dent_at_x)^2 + (y - dent_at_y)^2) / dent_spread)
    """

    distance: Positive = 70.0
    """z of the bowl's deepest point, mm."""

    width: Positive = 80.0
    """Extent along x, mm."""

    height: Positive = 80.0
    """Extent along y, mm."""

    radius: Positive = 90.0
    """Radius of the bowl, mm; more than half the sheet's diagonal."""

    ripple_depth: NonNegative = 4.0
    """Amplitude of the ripples, mm."""

    ripple_x: Positive = 6.0
    """Ripple wavelength along x divided by 2 pi, mm."""

    ripple_y: Positive = 8.0
    """Ripple wavelength along y divided by 2 pi, mm."""

    dent_depth: Finite = 6.0
    """Depth of the dent, mm; negative makes it a bump towards the camera."""

    dent_at_x: Finite = 8.0
    """x of the dent's centre, mm."""

    dent_at_y: Finite = -5.0
    """y of the dent's centre, mm."""

    dent_spread: Positive = 60.0
    """Squared distance over which the dent falls to 1/e, mm^2."""

    edge: Positive = 0.565
    """Length of a grid cell's side in x and y, mm. The default gives about 40,000 triangles."""

    def __post_init__(self) -> None:
        if np.hypot(self.width, self.height) / 2 >= self.radius:
            raise InputError(
                f"a bowl of radius {self.radius:g} mm cannot carry a sheet of "
                f"{self.width:g} x {self.height:g} mm",
                where="bumpy_sheet: radius",
                todo="make it larger than half the sheet's diagonal",
            )

    def depth(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return z at (x, y), all in mm, by the formula above."""
        bowl = self.radius - np.sqrt(self.radius**2 - x**2 - y**2)
        ripple = self.ripple_depth * np.sin(x / self.ripple_x) * np.cos(y / self.ripple_y)
        squared = (x - self.dent_at_x) ** 2 + (y - self.dent_at_y) ** 2
        return self.distance - bowl + ripple + self.dent_depth * np.exp(-squared / self.dent_spread)

    def mesh(self) -> Mesh:
        """Build the sheet."""
        return heightfield(self.depth, self.width, self.height, self.edge, "bumpy_sheet")
