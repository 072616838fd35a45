"""Solutions in the formats of other programs, one file an exporter."""

from . import colmap, mitsuba_scene, opencv, ply
from .registry import EXPORTERS, Exporter, export

__all__ = ["EXPORTERS", "Exporter", "colmap", "export", "mitsuba_scene", "opencv", "ply"]
