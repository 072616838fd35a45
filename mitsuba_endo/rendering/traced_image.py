"""Mitsuba's rendering of an image, in which an interrupt stays an interrupt."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..interrupts import as_interrupts


def traced_image(scene: Any, **options: Any) -> NDArray[np.float32]:
    """Return the image (H, W, channels) of ``mi.render(scene, **options)``.

    Raises:
        KeyboardInterrupt: one came while a plugin of Python's was traced, of which Dr.Jit makes a
            RuntimeError.
    """
    from .mitsuba_modules import mi

    with as_interrupts():
        return np.array(mi.render(scene, **options), np.float32)
