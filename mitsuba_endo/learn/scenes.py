"""Random scenes for training: a surface, an endoscope before it and a projector beside that.

The rabbit is never drawn: it is kept for tests.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.cameras import CameraModel
from ..geometry.endoscope import Endoscope, aimed_projector
from ..geometry.projection_models import projector_model
from ..geometry.transforms import RigidTransform
from ..shapes import Mesh, make_shape

KINDS = {
    "colon": 0.34, "tube": 0.14, "stomach": 0.16, "bumpy_sheet": 0.12, "concave_sphere": 0.06,
    "plane": 0.06, "box_planes": 0.05, "occluders": 0.07,
}  # fmt: skip
"""Share of each kind of surface. ``tube`` is a colon of extreme folds seen from close by,
``occluders`` a sheet with balls before it: both are there for their depth edges."""


def random_kind(rng: np.random.Generator) -> str:
    """Draw one of :data:`KINDS`."""
    shares = np.array(list(KINDS.values()))
    return str(rng.choice(list(KINDS), p=shares / shares.sum()))


def random_surface(kind: str, rng: np.random.Generator) -> Mesh:
    """Return a random surface of one of :data:`KINDS`, mm."""
    u = rng.uniform
    seed = int(rng.integers(1 << 30))
    if kind in ("colon", "tube"):
        return _colon(kind == "tube", seed, rng)
    if kind == "stomach":
        return make_shape(
            kind, seed=seed, fold_depth=u(2, 10), fold_spacing=u(11, 26), furrow_width=u(2.5, 6.5),
            orientation=u(0, np.pi), winding=u(0.1, 0.8), angle_x=0.95, angle_y=0.95, edge=0.9,
        )  # fmt: skip
    if kind == "concave_sphere":
        return make_shape(kind, radius=u(40, 80), angle_x=1.2, angle_y=1.2, edge=1.0)
    if kind == "plane":
        return make_shape(kind, width=260.0, height=260.0, edge=4.0)
    if kind == "box_planes":
        return make_shape(kind, roll=u(0, 2), lean_x=u(-0.3, 0.3), lean_y=u(-0.3, 0.3), edge=1.2,
                          size_a=u(60, 110), size_b=u(60, 110), size_c=u(60, 110))  # fmt: skip
    sheet = make_shape(
        "bumpy_sheet", width=130.0, height=130.0, radius=u(95, 250), ripple_depth=u(0, 5.5),
        ripple_x=u(4, 14), ripple_y=u(4, 14), dent_depth=u(-9, 9), dent_at_x=u(-15, 15),
        dent_at_y=u(-15, 15), dent_spread=u(25, 150), edge=0.9,
    )  # fmt: skip
    return _with_balls(sheet, rng) if kind == "occluders" else sheet


def _colon(extreme: bool, seed: int, rng: np.random.Generator) -> Mesh:
    u = rng.uniform
    radius = u(17, 32)
    deepest = 0.7 * radius - 2.5
    polyps = [
        {"along": u(12, 80), "angle": u(0, 6.28), "diameter": u(4, 14)}
        for _ in range(rng.integers(0, 4))
    ]
    return make_shape(
        "colon", seed=seed, radius=radius, bend=u(0, 0.8), bend_towards=u(0, 6.28),
        fold_depth=u(0.7, 1) * deepest if extreme else u(0.1, 0.8) * deepest,
        fold_spacing=u(12, 20) if extreme else u(15, 30),
        fold_width=u(1.5, 3.0) if extreme else u(2.2, 5), tenia_depth=u(0.5, 2.5),
        polyps=polyps, edge=1.1,
    )  # fmt: skip


def _with_balls(sheet: Mesh, rng: np.random.Generator) -> Mesh:
    """Put two to five balls before the sheet."""
    parts = [(sheet.vertices, sheet.faces)]
    for _ in range(rng.integers(2, 6)):
        radius = rng.uniform(4, 12)
        ball = make_shape("concave_sphere", distance=radius, radius=radius,
                          angle_x=1.45, angle_y=1.45, edge=0.7)  # fmt: skip
        # Turned round: the back of the bowl about the origin is the front of a ball.
        turned = ball.vertices * [1, -1, -1]
        centre = np.array([*rng.uniform(-22, 22, 2), rng.uniform(38, 60)])
        parts.append((turned + centre, ball.faces))
    offsets = np.cumsum([0] + [len(v) for v, _ in parts[:-1]])
    faces = np.concatenate([f + o for (_, f), o in zip(parts, offsets, strict=True)])
    return Mesh(np.concatenate([v for v, _ in parts]), faces)


def random_endoscope(
    kind: str, size: tuple[int, int], supersample: int, rng: np.random.Generator
) -> Endoscope:
    """Return an endoscope before a surface of ``kind``.

    The projector's focal length is in grid periods and its centre is 0: q are lattice coordinates
    that count from the pattern's middle.

    Args:
        kind: of the surface.
        size: width and height of the image, pixels.
        supersample: samples per pixel along each axis, for which the camera is made.
        rng: source of chance.
    """
    camera = _camera(size, supersample, rng)
    period_px = float(np.clip(np.exp(rng.normal(np.log(10.3), 0.26)), 6.5, 17))
    focal = float(camera.K[0, 0]) / supersample / period_px
    law = str(rng.choice(["pinhole", "direction_cosine"]))
    projector = projector_model(law, focal, (0.0, 0.0), aspect=rng.uniform(0.98, 1.02))
    return Endoscope(camera, _camera_pose(kind, rng), projector, _projector_pose(rng))


def _camera(size: tuple[int, int], supersample: int, rng: np.random.Generator) -> CameraModel:
    width, height = size
    fisheye = rng.random() < 0.25
    focal = width * (rng.uniform(0.45, 0.65) if fisheye else rng.uniform(0.58, 1.1))
    centre = np.array([width, height]) * (0.5 + rng.uniform(-0.03, 0.03, 2)) - 0.5
    K = np.diag([focal * supersample, focal * supersample * rng.uniform(0.98, 1.02), 1.0])
    K[:2, 2] = supersample * centre + (supersample - 1) / 2
    model = "opencv_fisheye" if fisheye else "opencv"
    # Stronger barrel distortion would fold the corners of the widest of these images over.
    terms = (rng.uniform(-0.02, 0.03), 0.0) if fisheye else (rng.uniform(-0.16, 0.03), 0.02)
    return CameraModel(model, width * supersample, height * supersample, K, terms)


def _camera_pose(kind: str, rng: np.random.Generator) -> RigidTransform:
    u = rng.uniform
    tube = kind in ("colon", "tube")
    if tube:
        centre = [*u(-5, 5, 2), u(0, 32)]
        tilt = 0.75 if rng.random() < 0.35 else 0.25
    else:
        centre = [*u(-9, 9, 2), u(-8, 28)]
        tilt = 0.55 if kind == "plane" else 0.35
    roll = Rotation.from_rotvec([0, 0, u(-np.pi, np.pi)])
    lean = Rotation.from_rotvec([*u(-tilt, tilt, 2), 0])
    return RigidTransform((lean * roll).as_matrix(), np.array(centre))


def _projector_pose(rng: np.random.Generator) -> RigidTransform:
    """Aim a projector a few millimetres beside the camera at what the camera looks at."""
    u = rng.uniform
    around, baseline = u(0, 2 * np.pi), u(2.5, 9)
    centre = np.array([baseline * np.cos(around), baseline * np.sin(around), u(-3, 3)])
    target = np.array([*rng.normal(0, 3, 2), u(35, 90)])
    roll = rng.normal(0, 0.12) if rng.random() < 0.7 else u(-0.6, 0.6)
    return aimed_projector(centre, target, Rotation.from_rotvec([0, 0, -roll]).as_matrix())
