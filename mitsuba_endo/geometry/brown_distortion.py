"""Brown's lens distortion of normalised image coordinates, after OpenCV.

``apply`` maps ideal normalised coordinates to distorted ones; ``remove`` is the exact inverse.
Coefficients may be floats or Dr.Jit scalars, and both directions are differentiable with respect
to the coordinates and the coefficients.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from .arrays import Array, namespace

_FIXED_POINT_STEPS = 8
"""They bring points before the fold near enough for Newton: tests/geometry tries whole images."""
_NEWTON_STEPS = 6
"""Each doubles the right digits: from one to double precision in four, and two to spare."""
_MIN_MAGNIFICATION = 0.2
"""Least local magnification that a fixed-point step divides by: the fold has none at all."""


@dataclass(frozen=True, eq=False)
class BrownDistortion:
    """Radial, tangential and rational distortion (k1, k2, p1, p2, k3[, k4, k5, k6]).

    With r2 = x^2 + y^2 and g = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3):
    x' = g x + 2 p1 x y + p2 (r2 + 2 x^2), y' = g y + p1 (r2 + 2 y^2) + 2 p2 x y.
    Source: OpenCV, "Camera Calibration and 3D Reconstruction".
    """

    coefficients: Sequence[Array] = ()
    """Up to 8 values in OpenCV order; missing ones are zero, none at all is the identity."""

    def apply(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Distort ideal normalised coordinates."""
        if not len(self.coefficients):
            return x, y
        _, _, p1, p2, *_ = self._padded()
        r2 = x * x + y * y
        g = self._magnification(x, y)
        return (
            g * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            g * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def remove(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Undo the distortion.

        Fixed-point steps bring the iterate near, Newton steps make it exact. In Dr.Jit only the
        last Newton step is differentiated: at the solution x it is x - J^-1 (D(x) - target), whose
        derivative is that of the implicit function.
        """
        if not len(self.coefficients):
            return x, y
        xp = namespace(x, y, *self.coefficients)
        frozen = BrownDistortion([xp.detach(c) for c in self.coefficients])
        xt, yt = xp.detach(x), xp.detach(y)
        a, b = xt, yt
        for _ in range(_FIXED_POINT_STEPS):
            da, db = frozen.apply(a, b)
            # Divided by the local magnification and halved, a step contracts up to the fold of
            # barrel distortion and for pincushion distortion of any strength.
            step = 0.5 / xp.maximum(frozen._magnification(a, b), _MIN_MAGNIFICATION)
            a, b = a + step * (xt - da), b + step * (yt - db)
        for _ in range(_NEWTON_STEPS):
            a, b = frozen._newton(frozen, a, b, xt, yt)
        return frozen._newton(self, xp.detach(a), xp.detach(b), x, y)

    def jacobian(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Return dx'/dx, dx'/dy = dy'/dx, dy'/dy."""
        if not len(self.coefficients):
            return 1 + 0 * x, 0 * x, 1 + 0 * x
        k1, k2, p1, p2, k3, k4, k5, k6 = self._padded()
        r2 = x * x + y * y
        top = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        bottom = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
        d_top = k1 + r2 * (2 * k2 + 3 * k3 * r2)
        d_bottom = k4 + r2 * (2 * k5 + 3 * k6 * r2)
        g = top / bottom
        dg = (d_top - g * d_bottom) / bottom  # derivative with respect to r2
        cross = 2 * (x * y * dg + p1 * x + p2 * y)
        return (
            g + 2 * (x * x * dg + p1 * y + 3 * p2 * x),
            cross,
            g + 2 * (y * y * dg + 3 * p1 * y + p2 * x),
        )

    def unfolded(self, x: Array, y: Array) -> Array:
        """Return a mask of ideal points on the branch that :meth:`remove` inverts.

        Far outside the image strong barrel distortion folds the plane back into it; there the
        Jacobian is not positive definite.
        """
        jxx, jxy, jyy = self.jacobian(x, y)
        return (jxx * jyy - jxy * jxy > 0) & (jxx + jyy > 0)

    def _magnification(self, x: Array, y: Array) -> Array:
        """Return g, the radial factor."""
        k1, k2, _, _, k3, k4, k5, k6 = self._padded()
        r2 = x * x + y * y
        return (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))

    def _newton(
        self, model: "BrownDistortion", a: Array, b: Array, xt: Array, yt: Array
    ) -> tuple[Array, Array]:
        """One Newton step at (a, b): the Jacobian is this object's, the residual is ``model``'s."""
        jxx, jxy, jyy = self.jacobian(a, b)
        da, db = model.apply(a, b)
        ra, rb = da - xt, db - yt
        det = jxx * jyy - jxy * jxy
        return a - (jyy * ra - jxy * rb) / det, b - (jxx * rb - jxy * ra) / det

    def _padded(self) -> list[Array]:
        return [*self.coefficients, *[0.0] * (8 - len(self.coefficients))]
