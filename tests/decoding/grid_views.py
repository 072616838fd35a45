"""Exact views of surfaces under the coded grid, for the tests of its decoder."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.synthetic import MeshScene
from mitsuba_endo.shapes import make_shape

WIDTH, HEIGHT = 400, 296
SIZE = (480, 384)
CAMERA = CameraModel(
    "opencv", WIDTH, HEIGHT, np.array([[260.0, 0, 204.3], [0, 258.0, 143.6], [0, 0, 1]]),
    (-0.12, 0.02, 0.0, 0.0),
)  # fmt: skip
PROJECTOR = projector_model("direction_cosine", 300.0, (239.5, 191.5))
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
    scene = MeshScene(mesh.vertices, mesh.faces)
    return scene.view(CAMERA, RigidTransform.identity(), PROJECTOR, POSES[shape], size=SIZE).q


def photo(
    q: NDArray[np.float64],
    pattern: CodedGrid | None = None,
    *,
    seed: int = 0,
    exposure: float = 0.9,
) -> NDArray[np.uint8]:
    """Return a gray 8-bit image (H, W) of the pattern at ``q``: shading, blur, noise and gamma.

    The package's path tracer and camera effects have no part in it.
    """
    rng = np.random.default_rng(seed)
    lit = np.isfinite(q[..., 0])
    light = (pattern or CodedGrid()).brightness(np.where(lit[..., None], q, -1e4))
    shading = 0.6 + 0.8 * gaussian_filter(rng.random(lit.shape), 25) / 0.5 - 0.8
    image = gaussian_filter(np.where(lit, light, 0) * shading + 0.01, 0.7)
    image = exposure * image / image.max()
    image += 0.01 * np.sqrt(image + 0.05) * rng.standard_normal(image.shape)
    return np.rint(255 * np.clip(image, 0, 1) ** (1 / 2.2)).astype(np.uint8)
