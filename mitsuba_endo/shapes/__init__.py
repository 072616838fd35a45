"""Procedural surfaces in millimetres, by name.

    from mitsuba_endo.shapes import make_shape
    make_shape("stomach", seed=7).save("stomach.ply")

Every surface lies in its scene's camera-like frame (x right, y down, z forward, the camera at the
origin) and faces the camera. Importing this package registers the shapes.
"""

from mitsuba_endo.shapes.box_planes import BoxPlanes
from mitsuba_endo.shapes.bumpy_sheet import BumpySheet
from mitsuba_endo.shapes.colon import Colon
from mitsuba_endo.shapes.concave_sphere import ConcaveSphere
from mitsuba_endo.shapes.grid import heightfield
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.plane import Plane
from mitsuba_endo.shapes.polyp import Polyp, PolypTruth
from mitsuba_endo.shapes.rabbit import Rabbit
from mitsuba_endo.shapes.registry import (
    SHAPES,
    Shape,
    make_shape,
    parameter_names,
    parse_shape,
    register,
)
from mitsuba_endo.shapes.stomach import Stomach

__all__ = [
    "SHAPES",
    "BoxPlanes",
    "BumpySheet",
    "Colon",
    "ConcaveSphere",
    "Mesh",
    "Plane",
    "Polyp",
    "PolypTruth",
    "Rabbit",
    "Shape",
    "Stomach",
    "heightfield",
    "make_shape",
    "parameter_names",
    "parse_shape",
    "register",
]
