"""How to go through a sequence."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SequenceOptions:
    """Options of :func:`mitsuba_endo.sequence.run.run_sequence`."""

    voxel: float | None = None
    """Side of the map's voxels, the unit of the rig's scale (mm, or first baselines where the scale
    is unknown). None: one and a half pixels on the surface, and at least a 64th of its
    distance."""
    first: int = 20
    """Frames that the focal length is taken from, before it is held."""
    fuse_every: int = 3
    """Of frames that hardly differ, one in so many is fused into the map."""
    vertices: int | None = 100_000
    """About how many the mesh keeps. None: as fine as the voxels."""
    seed: int = 0
    """Of the random samples, where a lost frame is looked for."""
