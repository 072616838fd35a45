"""The package in a few lines: :func:`calibrate`, :func:`track`, :func:`decode` and others.

They take paths, arrays or records, start what they need, and give back a :class:`Result`. The
package offers them under its own name, loaded when they are first asked for.
"""

from .calls import calibrate, decode, load, render
from .result import FramePose, Result
from .tracking import TrackedSequence, track

__all__ = [
    "FramePose", "Result", "TrackedSequence", "calibrate", "decode", "load", "render", "track",
]  # fmt: skip
