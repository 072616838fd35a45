"""The package in a few lines: :func:`calibrate`, :func:`decode`, :func:`render`, :func:`load`.

They take paths, arrays or records, start what they need, and give back a :class:`Result`. The
package offers them under its own name, loaded when they are first asked for.
"""

from .calls import calibrate, decode, load, render
from .result import FramePose, Result

__all__ = ["FramePose", "Result", "calibrate", "decode", "load", "render"]
