"""File names of maps and surfaces in a solution folder."""

import re
from collections.abc import Sequence
from pathlib import Path

SURFACE = "surface.ply"


def map_names(frames: Sequence[str]) -> list[str]:
    """Return the file names of the rendered maps: ``rendered.exr``, or one a frame."""
    return _names("rendered", frames)


def observed_names(frames: Sequence[str]) -> list[str]:
    """Return the file names of the observed maps: ``observed.exr``, or one a frame."""
    return _names("observed", frames)


def own_surface_name(frame: int) -> str:
    """Return the file name of the surface of one frame, where frames do not share one."""
    return f"surface_{frame:02d}.ply" if frame else SURFACE


def _names(kind: str, frames: Sequence[str]) -> list[str]:
    if len(frames) == 1:
        return [f"{kind}.exr"]
    plain = [re.sub(r"[^\w.-]+", "_", frame) for frame in frames]
    return [f"{kind}_{i:02d}_{Path(name).stem}.exr" for i, name in enumerate(plain)]
