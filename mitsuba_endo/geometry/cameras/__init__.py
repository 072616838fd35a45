"""Camera models: pixel to ray and back.

Pixels follow OpenCV: integer = pixel centre. Formulas run on NumPy and Dr.Jit components alike.
Adding a model is one file here with a class and ``@register_camera``.
"""

import importlib
import pkgutil

from .model import CameraModel
from .registry import CAMERAS, CameraLaw, register_camera

# A model registers itself when its file is imported: a new file need not be named here.
for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

__all__ = ["CAMERAS", "CameraLaw", "CameraModel", "register_camera"]
