"""File names of a frame's maps, surfaces and other files in a solution folder."""

import re
from collections.abc import Sequence
from pathlib import Path


def map_names(frames: Sequence[str]) -> list[str]:
    """Return the file names of the rendered maps: ``rendered.exr``, or one a frame."""
    return file_names("rendered", frames)


def observed_names(frames: Sequence[str]) -> list[str]:
    """Return the file names of the observed maps: ``observed.exr``, or one a frame."""
    return file_names("observed", frames)


def file_names(kind: str, frames: Sequence[str], suffix: str = ".exr") -> list[str]:
    """Return a file name of a kind for every frame: with the frame's number and name if several."""
    if len(frames) == 1:
        return [f"{kind}{suffix}"]
    plain = [re.sub(r"[^\w.-]+", "_", frame) for frame in frames]
    return [f"{kind}_{i:02d}_{Path(name).stem}{suffix}" for i, name in enumerate(plain)]
