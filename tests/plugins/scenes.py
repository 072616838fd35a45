"""Small asymmetric scenes shared by the plugin tests."""

import numpy as np

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.axes import to_world_from_pose

WIDTH, HEIGHT = 44, 30
"""Film of the test camera, pixels."""
PATTERN_WIDTH, PATTERN_HEIGHT = 40, 24

WORLD_FROM_CAMERA = RigidTransform.of([0.05, -0.08, 0.1], [0.4, -0.3, 0.2])
WORLD_FROM_PROJECTOR = RigidTransform.of([-0.03, 0.12, -0.2], [-1.5, 0.6, 0.5])
PROJECTOR = {
    "focal": 38.0, "centre_x": 21.3, "centre_y": 10.8, "aspect": 1.04,
    "k1": -0.11, "k2": 0.03, "p1": 2e-3, "p2": -3e-3, "k3": 5e-3,
}  # fmt: skip
CAMERA = {"fx": 36.0, "fy": 34.5, "cx": 22.6, "cy": 13.9}
LENSES = {
    "opencv": {"k1": -0.15, "k2": 0.04, "p1": 1e-3, "p2": -2e-3, "k3": 3e-3},
    "opencv_fisheye": {"k1": 0.03, "k2": -0.01, "k3": 2e-3, "k4": -5e-4},
    "omni": {"xi": 0.3, "k1": -0.11, "k2": 0.03, "p1": 1e-3, "p2": -2e-3, "k3": 3e-3},
    "double_sphere": {"xi": -0.2, "alpha": 0.57},
    "scaramuzza": {"b1": 0.01, "b2": -0.35, "b3": 0.06, "b4": -0.05, "d": 2e-3, "e": -3e-3},
}


def to_world(pose: RigidTransform):
    import mitsuba as mi

    return mi.ScalarTransform4f(to_world_from_pose(pose).tolist())


def film(**changes: object) -> dict:
    settings = {"width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}}
    return {"type": "hdrfilm", **settings, **changes}


def camera(model: str = "opencv", **changes: object) -> dict:
    lens = {"model": model, **CAMERA, **LENSES[model]}
    pose = to_world(WORLD_FROM_CAMERA)
    return {"type": "endoscope", **lens, "to_world": pose, "film": film(), **changes}


def projector(law: str = "pinhole", **changes: object) -> dict:
    pose = to_world(WORLD_FROM_PROJECTOR)
    settings = {**PROJECTOR, "law": law, "to_world": pose}
    size = {"width": PATTERN_WIDTH, "height": PATTERN_HEIGHT}
    return {"type": "doe_projector", **settings, **size, **changes}


def random_pattern(seed: int = 1) -> np.ndarray:
    shape = (PATTERN_HEIGHT, PATTERN_WIDTH, 3)
    return np.random.default_rng(seed).uniform(0.1, 1, shape).astype(np.float32)


def bitmap(pattern: np.ndarray) -> dict:
    import mitsuba as mi

    return {"type": "bitmap", "bitmap": mi.Bitmap(pattern), "raw": True, "wrap_mode": "clamp"}


def triangles(vertices: np.ndarray, faces: np.ndarray):
    import mitsuba as mi

    mesh = mi.Mesh("surface", len(vertices), len(faces))
    params = mi.traverse(mesh)
    params["vertex_positions"] = vertices.astype(np.float32).ravel()
    params["faces"] = faces.astype(np.uint32).ravel()
    params.update()
    return mesh


def tilted_plane():
    """Return the mesh of a large plane n . X = d in front of camera and projector, with (n, d)."""
    n, d = np.array([0.15, -0.1, -1.0]), -9.0
    xy = np.array([[-30, -30], [30, -30], [30, 30], [-30, 30.0]])
    z = (d - xy @ n[:2]) / n[2]
    return triangles(np.column_stack([xy, z]), np.array([[0, 2, 1], [0, 3, 2]])), n, d


def bumpy_grid(n: int = 9) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a coarse curved sheet that fills the view."""
    x, y = np.meshgrid(np.linspace(-9, 9, n), np.linspace(-7, 7, n))
    z = 9 + 0.6 * np.sin(0.5 * x) + 0.4 * np.cos(0.7 * y + 0.3 * x)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel()
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])
    return np.stack([x, y, z], -1).reshape(-1, 3), faces
