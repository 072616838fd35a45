"""Exact views of surfaces under the coded grid, for the tests of its decoder."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.laws import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.synthetic import MeshScene
from mitsuba_endo.shapes import make_shape

WIDTH, HEIGHT = 400, 296
POSES = {
    "sheet": RigidTransform.of([0.05, -0.10, 0.06], [-6.0, 1.2, 1.5]),
    "colon": RigidTransform.of([0.03, -0.11, 0.05], [-5.6, 1.3, 2.0]),
    "rabbit": RigidTransform.of([0.02, -0.09, -0.04], [-6.1, 0.7, 0.4]),
}


@cache
def view(shape: str, seed: int = 0) -> NDArray[np.float64]:
    """Return the exact coordinates (H, W, 2) of a view under the default pattern."""
    settings = {"seed": seed} if shape == "colon" else {}
    mesh = make_shape(shape if shape != "sheet" else "bumpy_sheet", **settings)
    K = np.array([[260.0, 0, 204.3], [0, 258.0, 143.6], [0, 0, 1]])
    camera = CameraModel("opencv", WIDTH, HEIGHT, K, (-0.12, 0.02, 0.0, 0.0))
    projector = projector_model("direction_cosine", 300.0, (239.5, 191.5))
    scene = MeshScene(mesh.vertices, mesh.faces)
    seen = scene.view(camera, RigidTransform.of(np.eye(3), np.zeros(3)), projector, POSES[shape],
                      size=(480, 384))  # fmt: skip
    return seen.q
