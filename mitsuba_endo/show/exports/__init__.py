"""Solutions in the formats of other programs, one file an exporter."""

from . import colmap, kalibr, mitsuba_scene, opencv, ply, ros
from .registry import EXPORTERS, Exporter, export

__all__ = [
    "EXPORTERS",
    "Exporter",
    "colmap",
    "export",
    "kalibr",
    "mitsuba_scene",
    "opencv",
    "ply",
    "ros",
]
