"""File names of the maps in a solution folder."""

import re
from collections.abc import Sequence
from pathlib import Path


def map_names(frames: Sequence[str]) -> list[str]:
    """Return the file names of the rendered maps: ``rendered.exr``, or one a frame."""
    return _names("rendered", frames)


def observed_names(frames: Sequence[str]) -> list[str]:
    """Return the file names of the observed maps: ``observed.exr``, or one a frame."""
    return _names("observed", frames)


def _names(kind: str, frames: Sequence[str]) -> list[str]:
    if len(frames) == 1:
        return [f"{kind}.exr"]
    plain = [re.sub(r"[^\w.-]+", "_", frame) for frame in frames]
    return [f"{kind}_{i:02d}_{Path(name).stem}.exr" for i, name in enumerate(plain)]
