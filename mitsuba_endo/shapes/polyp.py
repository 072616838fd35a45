"""Polyps: spherical caps of known size that stand on a wall."""

from collections.abc import Callable
from dataclasses import dataclass as plain_dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from pydantic.dataclasses import dataclass

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes.registry import CHECKED, Finite, Positive

Array = NDArray[np.float64]
Wall = Callable[[Array, Array], Array]

FILLET = 0.12
"""Radius of the rounding at a polyp's foot, in diameters."""

BLEND = 0.75
"""Width of the flattened wall around the foot, in diameters."""
FLATTEST = 0.1
"""Height of the flattest polyp over its diameter: flatter ones are no cap beside their fillet."""


@dataclass(frozen=True, kw_only=True, config=CHECKED)
class Polyp:
    """A sessile polyp: a spherical cap whose foot runs smoothly into the wall."""

    along: Finite
    """Place along the tube, mm."""

    angle: Finite
    """Place around the tube, rad."""

    diameter: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    """Diameter of the cap's base circle in the plane of the wall, mm."""

    height: Positive | None = None
    """Height over the wall, mm; none means half the diameter: a hemisphere."""

    def __post_init__(self) -> None:
        if (
            self.height is not None
            and not FLATTEST * self.diameter <= self.height <= self.diameter / 2
        ):
            raise InputError(
                f"a height of {self.height:g} mm does not suit a diameter of {self.diameter:g} mm",
                where="polyp: height",
                todo="choose between a tenth and half of the diameter",
            )

    def stand_on(self, wall: Wall) -> "PolypTruth":
        """Return the polyp's place and size on `wall`, which maps (along, angle) to points."""
        step = 0.05  # mm and, scaled below, rad: well under the wall's finest relief
        s, a = np.array(self.along), np.array(self.angle)
        turn = 1e-3
        base = wall(s, a)
        along = (wall(s + step, a) - wall(s - step, a)) / (2 * step)
        around = (wall(s, a + turn) - wall(s, a - turn)) / (2 * turn)
        normal = np.cross(along, around)  # row x column direction: into the lumen
        normal /= np.linalg.norm(normal)
        first = along / np.linalg.norm(along)
        height = self.diameter / 2 if self.height is None else self.height
        radius = (self.diameter**2 / 4 + height**2) / (2 * height)
        return PolypTruth(
            centre=base + (height - radius) * normal,
            normal=normal,
            base=base,
            diameter=self.diameter,
            height=height,
            sphere_radius=radius,
            along=first,
            stretch=(float(np.linalg.norm(along)), float(np.linalg.norm(around))),
        )


@plain_dataclass(frozen=True, eq=False)
class PolypTruth:
    """Where a polyp is and how large: what a measurement is compared with."""

    centre: Array
    """(3,) centre of the cap's sphere in the camera frame, mm. A hemisphere's is its base."""

    normal: Array
    """(3,) unit vector from the wall into the lumen."""

    base: Array
    """(3,) middle of the base circle, mm."""

    diameter: float
    """Diameter of the base circle, mm; a hemisphere's largest width."""

    height: float
    """Height of the cap over the base, mm."""

    sphere_radius: float
    """Radius of the cap's sphere, mm."""

    along: Array
    """(3,) unit tangent of the wall along the tube."""

    stretch: tuple[float, float]
    """Lengths on the wall per unit of (along, angle): mm per mm and mm per rad."""

    @property
    def foot(self) -> tuple[float, float]:
        """Polar angle of the cap's rim (rad), and distance from the axis where the foot ends (mm).

        The foot is a circular arc of radius FILLET * diameter, tangent to the cap and the wall.
        """
        fillet = FILLET * self.diameter
        depth = self.sphere_radius - self.height  # of the sphere's centre below the wall
        reach = np.sqrt((self.sphere_radius + fillet) ** 2 - (fillet + depth) ** 2)
        return float(np.arctan2(reach, fillet + depth)), float(reach)

    def profile(self, t: Array) -> tuple[Array, Array]:
        """Return the distance from the axis and the height, mm, for t in [0, 1] from top to foot.

        t is proportional to arc length.
        """
        rim, reach = self.foot
        fillet = FILLET * self.diameter
        arc, total = self.sphere_radius * rim, (self.sphere_radius + fillet) * rim
        run = t * total
        polar = np.minimum(run, arc) / self.sphere_radius
        # On the foot the slope falls from `rim` back to zero.
        slope = np.clip((total - run) / fillet, 0, rim)
        on_cap = run <= arc
        depth = self.sphere_radius - self.height
        away = np.where(on_cap, self.sphere_radius * np.sin(polar), reach - fillet * np.sin(slope))
        high = np.where(
            on_cap, self.sphere_radius * np.cos(polar) - depth, fillet * (1 - np.cos(slope))
        )
        return away, high


def raise_polyp(
    points: Array, along: Array, angle: Array, polyp: Polyp, truth: PolypTruth
) -> Array:
    """Return the wall's points (R, C, 3) with the polyp raised from them.

    The cap is rigid: it depends on the wall only through the base and its normal. Around its foot
    the wall is flattened into the base plane over BLEND diameters.

    Args:
        points: wall, mm.
        along: (R, C) position of each point along the tube, mm.
        angle: (R, C) position around it, rad.
        polyp: the polyp.
        truth: its place on this wall.
    """
    ds = truth.stretch[0] * (along - polyp.along)
    da = truth.stretch[1] * wrap_angle(angle - polyp.angle)
    distance = np.hypot(ds, da)
    _, reach = truth.foot
    outer = reach + BLEND * truth.diameter
    near = distance < outer
    distance = distance[near]
    away, high = truth.profile(np.minimum(distance / reach, 1))
    away = np.where(distance < reach, away, distance)
    scale = away / np.maximum(distance, 1e-12)
    around = np.cross(truth.normal, truth.along)
    rigid = (
        truth.base
        + (scale * ds[near])[:, None] * truth.along
        + (scale * da[near])[:, None] * around
        + high[:, None] * truth.normal
    )
    w = np.clip((distance - reach) / (outer - reach), 0, 1)
    weight = (w**3 * (10 - 15 * w + 6 * w**2))[:, None]
    raised = points.copy()
    raised[near] = (1 - weight) * rigid + weight * points[near]
    return raised


def wrap_angle(angle: Array) -> Array:
    """Return the angle moved into [-pi, pi), rad."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
