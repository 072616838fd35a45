"""What the user has chosen to see."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Choice:
    """The state of the viewer's controls."""

    frame: int | None = None
    """Index of the frame shown; None for all."""
    snapshot: int | None = None
    """Index in the history; None for the result."""
    colour: str = ""
    """Name of the quantity that colours the surface; empty for the first there is."""
    surface: bool = True
    frusta: bool = True
    rays: bool = False
    truth: bool = False
