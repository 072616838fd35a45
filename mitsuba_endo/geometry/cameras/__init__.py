"""Camera models: pixel to ray and back.

Pixels follow OpenCV: integer = pixel centre. Formulas run on NumPy and Dr.Jit components alike.
Adding a model is one file with a class and ``@register_camera``, its import here, and the names of
its coefficients in :data:`mitsuba_endo.rendering.keys.LENSES`, by which scenes give them.
"""

from . import brown, double_sphere, fisheye, omni, scaramuzza
from .model import CameraModel
from .registry import CAMERAS, CameraLaw, register_camera

__all__ = [
    "CAMERAS",
    "CameraLaw",
    "CameraModel",
    "brown",
    "double_sphere",
    "fisheye",
    "omni",
    "register_camera",
    "scaramuzza",
]
