"""Nodes of viser's scene that stay while nothing about them changes."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from matplotlib.colors import to_rgb

from ..frame_poses import Floats


@dataclass(eq=False)
class _Node:
    key: Any
    handle: Any


class Nodes:
    """What is on the scene: made when first wanted, hidden when not wanted any more."""

    def __init__(self, server: Any) -> None:
        self.server = server
        self._nodes: dict[str, _Node] = {}
        self._wanted: set[str] = set()

    @property
    def visible(self) -> list[str]:
        """Names of the nodes shown."""
        return sorted(self._wanted)

    @contextlib.contextmanager
    def drawing(self) -> Iterator[None]:
        """Show, all at once at the end, what the block wants and nothing else."""
        self._wanted = set()
        with self.server.atomic():
            yield
            for name, node in self._nodes.items():
                node.handle.visible = name in self._wanted

    def put(self, name: str, key: Any, make: Callable[[str], Any]) -> None:
        """Want a node; it is made unless it is there under the same key."""
        self._wanted.add(name)
        node = self._nodes.get(name)
        if node is None or node.key != key:
            self._nodes[name] = _Node(key, make(name))

    def put_lines(self, name: str, lines: Floats, colour: str, thickness: float = 2.0) -> None:
        """Want segments (N, 2, 3) in a colour, as thick as that many pixels."""
        self.put(
            name, (lines.tobytes(), colour),
            lambda name: self.server.scene.add_line_segments(
                name, lines, rgb_bytes(colour), thickness=thickness, thickness_units="screen"
            ),
        )  # fmt: skip


def rgb_bytes(colour: str) -> tuple[int, int, int]:
    """Return a matplotlib colour as 0 to 255."""
    r, g, b = (round(255 * c) for c in to_rgb(colour))
    return r, g, b


def said(*lines: str, bold: bool = False) -> str:
    """Return lines of text as HTML of the panel.

    Never Markdown: viser runs what it finds in that, and names of files are in what is said.
    """
    weight = "font-weight:bold;" if bold else ""
    text = "<br>".join(escape(line) for line in lines)
    return f'<div style="padding:0 14px 6px;{weight}overflow-wrap:anywhere">{text}</div>'


def listed(lines: Sequence[str]) -> str:
    """Return lines of text as an HTML list of the panel."""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<ul style="margin:0;padding:0 14px 6px 28px;overflow-wrap:anywhere">{items}</ul>'


def small(text: str) -> str:
    """Return a line of small text as HTML of the panel."""
    return (
        '<div style="padding:0 14px 6px;font-size:12px;overflow-wrap:anywhere">'
        f"{escape(text)}</div>"
    )
