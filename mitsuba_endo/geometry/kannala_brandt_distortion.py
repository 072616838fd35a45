"""Kannala and Brandt's fisheye distortion: an odd polynomial of the angle to the axis.

Coefficients may be floats or Dr.Jit scalars, and both directions are differentiable with respect
to the angle and the coefficients.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from .arrays import Array, namespace

_NEWTON_STEPS = 14
"""From the angle without distortion: tests/geometry tries 115 degrees off the axis."""


@dataclass(frozen=True, eq=False)
class KannalaBrandtDistortion:
    """theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).

    theta is the angle to the optical axis and theta_d the distance of the normalised image point
    from the centre. Source: OpenCV, module ``fisheye``, after Kannala and Brandt, "A generic camera
    model and calibration method for conventional, wide-angle, and fish-eye lenses", 2006.
    """

    coefficients: Sequence[Array] = ()
    """Up to 4 values k1..k4; missing ones are zero."""

    def apply(self, theta: Array) -> Array:
        """Return theta_d."""
        k1, k2, k3, k4 = self._padded()
        t2 = theta * theta
        return theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))

    def remove(self, theta_d: Array) -> Array:
        """Return theta, by Newton's method.

        Differentiable as the implicit function is, by the last step alone.
        """
        xp = namespace(theta_d, *self.coefficients)
        frozen = KannalaBrandtDistortion([xp.detach(c) for c in self.coefficients])
        target = xp.detach(theta_d)
        theta = target
        for _ in range(_NEWTON_STEPS):
            theta = theta - (frozen.apply(theta) - target) / frozen.slope(theta)
        theta = xp.detach(theta)
        return theta - (self.apply(theta) - theta_d) / frozen.slope(theta)

    def slope(self, theta: Array) -> Array:
        """Return d theta_d / d theta."""
        k1, k2, k3, k4 = self._padded()
        t2 = theta * theta
        return 1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4)))

    def _padded(self) -> list[Array]:
        return [*self.coefficients, *[0.0] * (4 - len(self.coefficients))]
