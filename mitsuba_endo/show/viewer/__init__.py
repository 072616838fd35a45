"""The live 3D viewer; the only room that knows viser."""

from .live import LiveView
from .live_sequence import LiveSequence
from .result import Viewer, open_viewer
from .server import address, running_server, wait_for_interrupt

__all__ = [
    "LiveSequence", "LiveView", "Viewer", "address", "open_viewer", "running_server",
    "wait_for_interrupt",
]  # fmt: skip
