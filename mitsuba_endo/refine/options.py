"""How decoded coordinates are refined."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RefineOptions:
    """Settings of a refinement; the defaults suit a grid of 6 to 17 camera pixels a period."""

    window: float = 6.0
    """Standard deviation of the Gaussian window in which image and pattern are compared, camera
    pixels."""
    iterations: int = 4
    """Most linearisations; it ends before if the steps are small."""
    gamma: float = 2.2
    """Response of the camera: images hold brightness^(1 / gamma)."""
    blur: float | None = None
    """Standard deviation by which the pattern is blurred, pattern pixels. None: fitted."""
    rounds: int = 2
    """Times that a map grows by up to two cells at its borders and into its holes; 0: it does
    not."""
