"""Which frame of a truth is which frame of a solution: by name, strictly.

A name may have folders, ``left/map.exr``. Two names are the same if their last parts are, as far as
both have some; suffixes of maps and images do not count. So a bare name fits one with a folder, but
names whose folders differ are of different frames, whatever the files are called.
"""

from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Literal

from ..errors import InputError

MatchBy = Literal["name", "order"]
Matched = Literal["name", "order", "only"]
"""``only``: one frame on each side, which are called differently."""

_SUFFIXES = (
    ".exr", ".npz", ".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm", ".ppm",
)  # fmt: skip
"""Of files that a frame may be called after."""
_TOLD = 5
"""Names that a message lists."""


def match_names(
    frame_names: Sequence[str], true: Sequence[Sequence[str]], by: MatchBy = "name"
) -> tuple[list[int], Matched]:
    """Return for every frame the index of the true one.

    Args:
        frame_names: names of a solution's frames.
        true: the names that each frame of the truth may go by.
        by: ``order`` pairs them as they come, which somebody must ask for.

    Raises:
        InputError: a frame has no partner, or two that it might be; or two frames have one.
    """
    if by == "order":
        if len(frame_names) != len(true):
            raise InputError(
                f"{len(true)} frames, and the solution has {len(frame_names)}", "truth",
                "match them by name",
            )  # fmt: skip
        return list(range(len(frame_names))), "order"
    candidates = [
        [j for j, names in enumerate(true) if _any_same(name, names)] for name in frame_names
    ]
    if len(frame_names) == len(true) == 1 and not candidates[0]:
        _refuse_other_folder(frame_names[0], true)
        return [0], "only"
    chosen = [_partner(*pair, true) for pair in zip(frame_names, candidates, strict=True)]
    for i, j in enumerate(chosen):
        if j in chosen[:i]:
            twice = frame_names[chosen.index(j)]
            raise InputError(
                f"frames {twice} and {frame_names[i]} are both called as {true[j][0]} of the truth",
                "solution", "name frames with their folders, or match by order",
            )  # fmt: skip
    return chosen, "name"


def _partner(name: str, candidates: list[int], true: Sequence[Sequence[str]]) -> int:
    exact = [j for j in candidates if name in true[j]]
    candidates = exact or candidates
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        names = ", ".join(true[j][0] for j in candidates[:_TOLD])
        raise InputError(
            f"may be {names} of the truth", f"solution: frame {name}",
            "name frames with their folders, or match by order",
        )  # fmt: skip
    _refuse_other_folder(name, true)
    names = ", ".join(names[0] for names in true[:_TOLD])
    more = f" and {len(true) - _TOLD} more" if len(true) > _TOLD else ""
    raise InputError(
        f"no frame of this name in the truth, which has {names}{more}",
        f"solution: frame {name}", "name the truth's frames as the maps, or match by order",
    )  # fmt: skip


def _refuse_other_folder(name: str, true: Sequence[Sequence[str]]) -> None:
    """Refuse a name that the truth has in another folder only, and say which."""
    base = _parts(name)[-1]
    for other in (other for names in true for other in names):
        if _parts(other)[-1] == base:
            raise InputError(
                f"the truth has a frame of this name in another folder, {other}",
                f"solution: frame {name}", "give the truth of the same captures",
            )  # fmt: skip


def _any_same(name: str, others: Sequence[str]) -> bool:
    return any(_same(name, other) for other in others)


def _same(a: str, b: str) -> bool:
    first, second = _parts(a), _parts(b)
    shared = min(len(first), len(second))
    return first[-shared:] == second[-shared:]


def _parts(name: str) -> tuple[str, ...]:
    path = PurePosixPath(name.replace("\\", "/"))
    return (path.with_suffix("") if path.suffix.lower() in _SUFFIXES else path).parts or (name,)
