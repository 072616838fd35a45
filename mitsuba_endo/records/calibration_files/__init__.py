"""Whole calibrations in files: OpenCV's, COLMAP's and the package's own; one file a format."""

from . import opencv, colmap_calibration, solution_file  # isort: skip  (in the order in which they are tried)
from .registry import CALIBRATION_FORMATS, read_calibration

__all__ = [
    "CALIBRATION_FORMATS",
    "colmap_calibration",
    "opencv",
    "read_calibration",
    "solution_file",
]
