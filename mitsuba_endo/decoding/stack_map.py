"""The map of a stack whose pattern a rig knows, from a folder of its photographs."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..records.correspondence import CorrespondenceMap
from .stack import decode_stack
from .stack_files import StackFiles, stack_paths
from .stack_plan import Kind
from .stack_reading import StackReading, StackRequest, find_reading, read_by_names

STACK = "stack"
"""Pattern of a stack whose kind is to be found."""
KINDS: dict[str, Kind | None] = {
    STACK: None, "gray": "gray", "phase": "phase", "gray+phase": "gray+phase"
}  # fmt: skip
"""Patterns that are projected one after the other, by what ``--pattern`` calls them."""


@dataclass(frozen=True, eq=False)
class StackMap:
    """What was decoded of a stack."""

    map: CorrespondenceMap
    reading: StackReading
    decoded: float
    """Share of the lit pixels that have a coordinate."""
    note: str
    """What was done to the images that their reader should know, a sentence."""


def stack_map(
    stack: Path,
    size: tuple[int, int],
    pattern: str,
    advance: Callable[[float], None] = lambda share: None,
) -> StackMap:
    """Decode a stack; what its images show is told by their names, or found.

    Args:
        stack: folder of photographs, or TIFF file of pages.
        size: width and height of the pattern, pixels.
        pattern: one of :data:`KINDS`.
        advance: called with the share that is done.

    Raises:
        InputError: the path is neither, or the images fit no reading or two.
        NothingDecodedError: they show no pattern.
    """
    if not stack.is_dir() and stack.suffix.lower() not in (".tif", ".tiff"):
        todo = "give a folder of photographs for each frame"
        raise InputError("is no stack", str(stack), todo)
    request = StackRequest(width=size[0], height=size[1], kind=KINDS[pattern])
    paths = stack_paths([stack])
    reading = read_by_names(paths, request)
    files = StackFiles(paths)
    reading = reading or find_reading(files, request, advance=lambda share: advance(share / 2))
    result = decode_stack(
        files, reading.plan, order=reading.order, advance=lambda share: advance((1 + share) / 2)
    )
    map_ = CorrespondenceMap(result.q, stack.resolve().stem, result.weight)
    share = float(result.decoded.sum() / result.lit.sum())
    return StackMap(map_, reading, share, next(iter(files.notes), ""))
