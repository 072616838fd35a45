"""One mesh from the range images of several frames."""

from .frame import RangeFrame
from .fuse import FusedMesh, fuse, surface_of, voxel_size
from .tsdf import Volume

__all__ = ["FusedMesh", "RangeFrame", "Volume", "fuse", "surface_of", "voxel_size"]
