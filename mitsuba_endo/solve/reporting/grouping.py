"""Sentences about many frames, grouped so that a reader sees each matter once."""

import re
from collections.abc import Iterable

from .estimates import listed


def alike(reason: str) -> str:
    """Return what reasons that differ in numbers and names of frames alone have in common."""
    return re.sub(r"\S*\d\S*|\(.*?\)", "", reason.split("cannot be separated from")[0])


def grouped(reasons: Iterable[tuple[str, str]], one: str, several: str) -> list[str]:
    """Return a sentence for every matter, with the names of the frames that it is about.

    Args:
        reasons: names of frames and why.
        one: what to say of one, with ``{names}``.
        several: of more, with ``{count}`` and ``{names}``; the reason of the first follows.
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for name, reason in reasons:
        groups.setdefault(alike(reason), []).append((name, reason))
    out = []
    for group in groups.values():
        names = listed([name for name, _ in group])
        head = (one if len(group) == 1 else several).format(names=names, count=len(group))
        first = f"{group[0][0]}: " if len(group) > 1 else ""
        out.append(f"{head}: {first}{group[0][1]}")
    return out
