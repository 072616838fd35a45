"""Rays through pixel centres."""

from typing import Any

from .axes import fraction_from_pixel
from .mitsuba_modules import dr, mi


def pixel_rays(sensor: Any) -> tuple[Any, int, int]:
    """Return a ray for every pixel centre of the film's crop window, row by row, and its size.

    Exactly one ray a pixel: a reconstruction filter would blend coordinates across depth steps.
    """
    width, height = (int(n) for n in sensor.film().crop_size())
    index = dr.arange(mi.UInt32, width * height)
    u, v = mi.Float(index % width), mi.Float(index // width)
    centre = mi.Point2f(fraction_from_pixel(u, v, width, height))
    ray, _ = sensor.sample_ray(sensor.shutter_open(), 0.5, centre, mi.Point2f(0.5))
    return ray, width, height
