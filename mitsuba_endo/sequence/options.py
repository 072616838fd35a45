"""How to go through a sequence."""

from dataclasses import dataclass

from ..records.validation import Count, Length, Seed, check_fields


@dataclass(frozen=True)
class SequenceOptions:
    """Options of :func:`mitsuba_endo.sequence.run.run_sequence`.

    Raises:
        InputError: a value that means nothing, when they are made.
    """

    voxel: Length | None = None
    """Side of the map's voxels, the unit of the rig's scale (mm, or first baselines where the scale
    is unknown). None: one and a half pixels on the surface, and at least a 64th of its
    distance."""
    first: Count = 20
    """Frames that the focal length is taken from, before it is held."""
    fuse_every: Count = 3
    """Of frames that hardly differ, one in so many is fused into the map."""
    vertices: Count | None = 100_000
    """About how many the mesh keeps. None: as fine as the voxels."""
    seed: Seed = 0
    """Of the random samples, where a lost frame is looked for."""

    def __post_init__(self) -> None:
        """Refuse values that mean nothing."""
        check_fields(self, "options")
