"""A patch of stomach wall with rugae."""

import numpy as np
from numpy.typing import NDArray
from pydantic.dataclasses import dataclass

from mitsuba_endo.shapes.grid import check_size, grid_mesh, sphere_patch
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.noise import random_waves, ridge_waves
from mitsuba_endo.shapes.registry import (
    CHECKED,
    Finite,
    HalfAngle,
    NonNegative,
    Positive,
    Seed,
    register,
)


@register("stomach")
@dataclass(frozen=True, kw_only=True, config=CHECKED)
class Stomach:
    """A concave wall that carries rugae: thick, winding, forking folds.

    The wall is a piece of a sphere; the folds rise from it towards the sphere's centre by
    fold_depth * (1 - exp(-(d / furrow_width)^2)), where d is about the distance from the nearest
    furrow. Furrows are the zeros of a random field of waves that travel across the folds.
    """

    distance: Positive = 75.0
    """z of the bare wall on the axis, mm."""

    radius: Positive = 80.0
    """Radius of the wall, mm."""

    angle_x: HalfAngle = 0.75
    """Half-angle from left to right, seen from the wall's centre, rad."""

    angle_y: HalfAngle = 0.68
    """Half-angle from top to bottom, seen from the wall's centre, rad."""

    fold_depth: NonNegative = 6.5
    """Height of a fully developed fold over the wall, mm."""

    fold_spacing: Positive = 18.0
    """Mean distance of neighbouring folds, mm."""

    furrow_width: Positive = 4.8
    """Distance from the bottom of a furrow at which the wall has risen by 63 %, mm."""

    orientation: Finite = 0.5
    """Angle of the folds from the x axis towards +y, rad."""

    winding: NonNegative = 0.4
    """Spread of the folds' direction, rad: 0 gives straight parallel folds."""

    roughness: NonNegative = 0.08
    """Root mean square of the fine relief on top of the folds, mm."""

    edge: Positive = 0.8
    """Length of a grid cell's side, mm. The default gives about 40,000 triangles."""

    seed: Seed = 0
    """Chooses the course of the folds."""

    @property
    def centre(self) -> NDArray[np.float64]:
        """(3,) centre of the wall's sphere, mm."""
        return np.array([0.0, 0.0, self.distance - self.radius])

    def mesh(self) -> Mesh:
        """Build the wall."""
        edge_angle = self.edge / self.radius
        check_size(8 * self.angle_x * self.angle_y / edge_angle**2, "stomach")
        directions, angles = sphere_patch(self.angle_x, self.angle_y, edge_angle)
        rise = self._rise(self.radius * angles)
        return grid_mesh(self.centre + (self.radius - rise)[..., None] * directions)

    def _rise(self, on_wall: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the height over the wall (R, C) at the wall coordinates (R, C, 2), mm."""
        rng = np.random.default_rng(self.seed)
        # A slow shift of the coordinates makes the folds meander.
        shift = [random_waves(on_wall, 3.5 * self.fold_spacing, rng) for _ in range(2)]
        bent = on_wall + self.winding * 0.5 * self.fold_spacing * np.stack(shift, axis=-1)
        # Furrows lie at the zeros of the field, of which each wave has two. Dividing by the slope
        # gives them all one width; the constant keeps the quotient finite on the folds' tops.
        wavelength = 2 * self.fold_spacing
        field, slope = ridge_waves(bent, wavelength, self.orientation, self.winding, rng)
        distance = field / np.hypot(slope, 0.4 * 2 * np.pi / wavelength)
        rough = self.roughness * random_waves(on_wall, 8.0, rng)
        return self.fold_depth * -np.expm1(-((distance / self.furrow_width) ** 2)) + rough
