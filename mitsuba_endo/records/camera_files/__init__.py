"""Camera files of other programs, one file a format; which it is follows from the content."""

from . import calib_io, colmap, kalibr, matlab, matrices, ocamcalib, procam, ros, scalars
from .camera_file import CameraFile
from .registry import FORMATS, read_camera_file

__all__ = [
    "FORMATS",
    "CameraFile",
    "calib_io",
    "colmap",
    "kalibr",
    "matlab",
    "matrices",
    "ocamcalib",
    "procam",
    "read_camera_file",
    "ros",
    "scalars",
]
