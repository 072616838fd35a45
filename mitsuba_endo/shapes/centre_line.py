"""The curved axis of a tube."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CentreLine:
    """A plane curve through the origin along +z that turns smoothly to one side.

    The heading is 0 up to the origin and bend * w^2 (3 - 2 w) at arc length s = w * length, so
    that it is straight where the camera is and straight again after `length`.
    """

    start: float
    """First arc length, mm, at most 0."""

    length: float
    """Arc length at which the turn is complete, mm."""

    stop: float
    """Last arc length, mm, at least `length`."""

    bend: float
    """Total turn, rad."""

    towards: float
    """Side of the turn, as an angle from +x towards +y, rad."""

    @property
    def sharpest(self) -> float:
        """Largest curvature, 1/mm: the derivative of the heading half-way."""
        return 1.5 * self.bend / self.length

    def frame(self, s: Array) -> tuple[Array, Array, Array]:
        """Return the point and two unit normals, each (..., 3), at arc lengths s (...), mm.

        At s <= 0 the normals are +x and +y. They turn with the curve and never twist about it.
        """
        heading = self._heading(s)[..., None]
        side = np.array([np.cos(self.towards), np.sin(self.towards), 0.0])
        across = np.array([-np.sin(self.towards), np.cos(self.towards), 0.0])
        axis = np.array([0.0, 0.0, 1.0])
        offset = self._path(s)
        centre = offset[..., :1] * side + offset[..., 1:] * axis
        leaning = np.cos(heading) * side - np.sin(heading) * axis
        first = np.cos(self.towards) * leaning - np.sin(self.towards) * across
        second = np.sin(self.towards) * leaning + np.cos(self.towards) * across
        return centre, first, second

    def _heading(self, s: Array) -> Array:
        w = np.clip(s / self.length, 0, 1)
        return self.bend * w**2 * (3 - 2 * w)

    @cached_property
    def _path(self) -> CubicSpline:
        """Sideways and forward position against arc length, mm."""
        s = np.linspace(self.start, self.stop, 801)
        heading = self._heading(s)
        steps = np.stack([np.sin(heading), np.cos(heading)], axis=1)
        path = CubicSpline(s, cumulative_simpson(steps, x=s, axis=0, initial=0))
        return CubicSpline(s, path(s) - path(0.0))
