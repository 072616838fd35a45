"""The peer: pycolmap's bundle adjustment of a camera and a projector, taken as a second camera."""

import numpy as np
from reproduce.bundle import Adjusted
from reproduce.bundle import adjust as adjust_bundle

from .scene import PLANE_MM, Scene

__all__ = ["Adjusted", "adjust"]


def adjust(scene: Scene) -> Adjusted:
    """Adjust the scene from the start that our solvers get: focal length 10 % off, a plane."""
    q = scene.map.q.astype(np.float64)
    return adjust_bundle(q, scene.camera, scene.rig, PLANE_MM, "SIMPLE_PINHOLE")
