"""Several range images of one rigid surface with their truth, by ray casting.

The relief is a height field met by marching and bisection in NumPy, so that nothing here shares
code with what it tests; organs are meshes of :mod:`mitsuba_endo.shapes` met by Mitsuba. Every frame
measures in its own unit (its baseline), and its noise is smooth and grows with the squared range,
as triangulation makes it. Units mm and radians.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_angle
from mitsuba_endo.initialisation.registration import RangeImage, Registration
from mitsuba_endo.shapes import Mesh, make_shape

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], Floats]
"""Distance of the first hit from an origin (3,) along unit directions (H, W, 3); NaN = miss."""

BASELINE = 6.3
MAX_SHIFT, MAX_TURN = 25.0, np.radians(15)


@dataclass(frozen=True, eq=False)
class Scene:
    """Frames of one surface: what a solver is given, and the truth."""

    images: list[RangeImage]
    world_from_camera: list[RigidTransform]
    """mm."""
    baseline: list[float]
    """mm."""
    overlap: list[float]
    """Share of each frame's pixels that the previous frame sees (the first: 1)."""


def wide_camera(width: int = 272, height: int = 216) -> CameraModel:
    """A camera of about 64 degrees whose two axes differ in everything."""
    K = np.array([[0.8 * width, 0, 0.47 * width], [0, 0.82 * width, 0.54 * height], [0, 0, 1]])
    return CameraModel("opencv", width, height, K, (-0.12, 0.04, 0.001, -0.0015, 0.0))


# ---------------------------------------------------------------------------------------- surfaces


def height_field(height: Callable[[Floats, Floats], Floats], half: float = 150.0) -> Surface:
    """The sheet z = height(x, y), tabulated over +-half mm."""
    step = 0.4
    axis = np.arange(-half, half + step, step)
    table = height(*np.meshgrid(axis, axis)).astype(np.float32)

    def gap(origin: Floats, directions: Floats, s: Floats) -> Floats:
        p = (origin + s[..., None] * directions).astype(np.float32)
        at = [(p[..., k] + half) / step for k in (0, 1)]
        z = cv2.remap(table, *at, cv2.INTER_LINEAR, borderValue=float("nan"))
        return (p[..., 2] - z).astype(np.float64)

    def hit(origin: Floats, directions: Floats) -> Floats:
        low, high = np.zeros(directions.shape[:2]), np.full(directions.shape[:2], np.nan)
        for s in np.arange(2.0, 250.0, 2.0):
            s = np.full_like(low, s)
            behind = gap(origin, directions, s) > 0
            open_ = np.isnan(high)
            high[open_ & behind] = s[open_ & behind]
            low[open_ & ~behind] = s[open_ & ~behind]
        for _ in range(12):
            middle = (low + high) / 2
            behind = gap(origin, directions, middle) > 0
            low, high = np.where(behind, low, middle), np.where(behind, middle, high)
        return (low + high) / 2

    return hit


def bumpy_sheet(rng: np.random.Generator) -> Surface:
    """The prototypes' bowl with ripples and a dent, of random size, with a few more dents."""
    radius, ripple = rng.uniform(90, 140), rng.uniform(2.5, 4.5)
    kx, ky = 1 / rng.uniform(5.5, 8), 1 / rng.uniform(6, 9)
    phase, at, depth = rng.uniform(0, 6, 2), rng.uniform(-60, 60, (12, 2)), rng.uniform(3, 6, 12)

    def height(x: Floats, y: Floats) -> Floats:
        bowl = np.sqrt(np.maximum(radius**2 - x**2 - y**2, (0.4 * radius) ** 2)) - radius
        z = 70 + bowl + ripple * np.sin(x * kx + phase[0]) * np.cos(y * ky + phase[1])
        for (cx, cy), d in zip(at, depth, strict=True):
            z = z + d * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / 60)
        return z

    return height_field(height)


def random_relief(rng: np.random.Generator, amplitude: float = 1.8) -> Surface:
    """A tilted sheet with waves of 22-60 mm of random direction."""
    wave = rng.uniform(22, 60, 10)
    around, phase = rng.uniform(0, 2 * np.pi, (2, 10))
    k = 2 * np.pi / wave * np.stack([np.cos(around), np.sin(around)])
    tilt, weight = rng.uniform(-0.25, 0.25, 2), amplitude * rng.uniform(0.4, 1.2, 10) * wave / 40

    def height(x: Floats, y: Floats) -> Floats:
        z = 70 + tilt[0] * x + tilt[1] * y
        for j in range(10):
            z = z + weight[j] * np.sin(k[0, j] * x + k[1, j] * y + phase[j])
        return z

    return height_field(height)


def organ(name: str, **params: object) -> Surface:
    """A shape of mitsuba_endo.shapes, met by Mitsuba."""
    return of_mesh(make_shape(name, **params))


def rabbit_before_wall(distance: float, wall: float) -> Surface:
    """The rabbit before a plane that fills the rest of the view, mm along z."""
    thing, behind = make_shape("rabbit", distance=distance), make_shape("plane", distance=wall)
    faces = np.concatenate([thing.faces, behind.faces + len(thing.vertices)])
    return of_mesh(Mesh(np.concatenate([thing.vertices, behind.vertices]), faces))


def of_mesh(mesh: Mesh) -> Surface:
    from mitsuba_endo import backend

    backend.use("llvm_ad_rgb")
    from mitsuba_endo.rendering.synthetic import MeshScene

    scene = MeshScene(mesh.vertices, mesh.faces)

    def hit(origin: Floats, directions: Floats) -> Floats:
        met = scene.cast(origin, directions.reshape(-1, 3))
        t = np.linalg.norm(met.points - origin, axis=1)
        return np.where(met.hit, t, np.nan).reshape(directions.shape[:2])

    return hit


SURFACES: dict[str, Callable[[np.random.Generator], Surface]] = {
    "bumpy_sheet": bumpy_sheet,
    "relief": random_relief,
    "stomach": lambda rng: organ(
        "stomach", seed=int(rng.integers(1 << 30)), orientation=rng.uniform(0, 3),
        angle_x=1.2, angle_y=1.15, edge=0.9,
    ),
    "colon": lambda rng: organ(
        "colon", seed=int(rng.integers(1 << 30)), bend_towards=rng.uniform(0, 6), edge=0.9,
        behind=45.0,
    ),
}  # fmt: skip


# ------------------------------------------------------------------------------------------ frames


def random_scene(
    kind: str,
    seed: int,
    *,
    frames: int = 4,
    min_overlap: float = 0.4,
    least_step: float = 0.0,
    noise: float | None = None,
) -> Scene:
    """Walk a camera over a random surface of a kind of :data:`SURFACES`.

    Each step is up to 25 mm and up to 15 degrees about any axis; steps that bring the camera
    nearer than 8 mm to the wall (40 mm to a sheet) or lose the common view are drawn again.

    Args:
        min_overlap: least share of a frame's pixels that the previous one sees.
        least_step: least size of a step, as a share of 25 mm and of 15 degrees.
        noise: standard deviation of the range at 70 mm, mm; 0.1 to 0.3 where absent.
    """
    rng = np.random.default_rng(seed)
    surface, camera = SURFACES[kind](rng), wide_camera()
    rays = camera.rays(camera.pixel_grid())
    nearest = 8.0 if kind == "colon" else 40.0
    poses, ranges, overlaps = [RigidTransform.identity()], [], [1.0]
    ranges.append(cast(surface, poses[0], rays))
    while len(poses) < frames:
        pose = poses[-1] @ random_step(rng, least_step)
        seen = cast(surface, pose, rays)
        if np.isfinite(seen).mean() < 0.6 or np.nanpercentile(seen, 2) < nearest:
            continue
        common = overlap(camera, rays, (seen, ranges[-1]), (pose, poses[-1]))
        if common >= min_overlap:
            poses.append(pose)
            ranges.append(seen)
            overlaps.append(common)
    noise = rng.uniform(0.1, 0.3) if noise is None else noise
    baseline = [BASELINE * rng.uniform(0.9, 1.1) for _ in poses]
    measured = [
        with_holes(with_noise(r, noise, rng), 0.12, rng) / b
        for r, b in zip(ranges, baseline, strict=True)
    ]
    return Scene([RangeImage(rays, r, camera) for r in measured], poses, baseline, overlaps)


def random_step(rng: np.random.Generator, least: float = 0.0) -> RigidTransform:
    """Draw a motion of up to 25 mm and 15 degrees, and at least ``least`` times that."""
    axis, towards = rng.normal(size=(2, 3))
    turn = rng.uniform(least, 1) * MAX_TURN * axis / np.linalg.norm(axis)
    return RigidTransform.of(
        turn, rng.uniform(least, 1) * MAX_SHIFT * towards / np.linalg.norm(towards)
    )


def cast(surface: Surface, world_from_camera: RigidTransform, rays: Floats) -> Floats:
    return surface(world_from_camera.t, world_from_camera.rotate(rays))


def with_noise(ranges: Floats, sigma: float, rng: np.random.Generator) -> Floats:
    """Add noise that is white in inverse range, smoothed over about 3 px, ``sigma`` mm at 70 mm.

    A slow bend of half that size stands for the frame's imperfect calibration.
    """
    white = cv2.GaussianBlur(rng.standard_normal(ranges.shape), (0, 0), 1.5)
    y, x = np.mgrid[-1 : 1 : ranges.shape[0] * 1j, -1 : 1 : ranges.shape[1] * 1j]
    a = rng.normal(size=5)
    bend = a[0] * x + a[1] * y + a[2] * x * y + a[3] * x * x + a[4] * y * y
    return ranges + sigma * (ranges / 70) ** 2 * (white / white.std() + 0.5 * bend)


def with_holes(ranges: Floats, share: float, rng: np.random.Generator) -> Floats:
    """Remove a share of the pixels in blobs of some 10 px: shadows, highlights, failed decoding."""
    blobs = cv2.GaussianBlur(rng.standard_normal(ranges.shape), (0, 0), 5.0)
    return np.where(blobs > np.quantile(blobs, share), ranges, np.nan)


def overlap(
    camera: CameraModel,
    rays: Floats,
    ranges: tuple[Floats, Floats],
    poses: tuple[RigidTransform, RigidTransform],
) -> float:
    """Return the share of the first frame's seen pixels that the second sees too."""
    seen = np.isfinite(ranges[0])
    points = (poses[1].inverse() @ poses[0]).apply(ranges[0][seen, None] * rays[seen])
    uv = np.round(camera.project(np.where(points[:, 2:] > 1, points, np.nan)))
    inside = (uv >= 0).all(-1) & (uv < [camera.width, camera.height]).all(-1)
    u, v = np.where(inside[:, None], uv, 0).astype(int).T
    distance = np.linalg.norm(points, axis=-1)
    return float((inside & (np.abs(ranges[1][v, u] / distance - 1) < 0.02)).mean())


# ------------------------------------------------------------------------------------------- truth


@dataclass(frozen=True)
class PoseError:
    """How far a registered frame is from its true pose."""

    rotation: float
    """Degrees."""
    translation: float
    """Relative to the mean range."""
    scale: float
    """Relative."""

    @property
    def right(self) -> bool:
        """Within the basin of the joint solve."""
        return self.rotation < 2 and self.translation < 0.03


def pose_errors(scene: Scene, found: list[Registration], reference: int = 0) -> list[PoseError]:
    """Compare each frame with the truth, seen from frame ``reference`` and in its baseline.

    Errors are NaN, which is not right, for a frame that was left out, and for all frames if
    ``reference`` was.
    """
    base, errors = found[reference], []
    for k, (pose, image) in enumerate(zip(scene.world_from_camera, scene.images, strict=True)):
        if not (found[k].reliable and base.reliable):
            errors.append(PoseError(*[float("nan")] * 3))
            continue
        true = scene.world_from_camera[reference].inverse() @ pose
        mine = base.world_from_camera.inverse() @ found[k].world_from_camera
        unit = scene.baseline[reference] / base.scale
        mean = float(np.nanmean(image.range)) * scene.baseline[k]
        errors.append(
            PoseError(
                float(np.degrees(rotation_angle(true.R.T @ mine.R))),
                float(np.linalg.norm(unit * mine.t - true.t)) / mean,
                abs(found[k].scale * unit / scene.baseline[k] - 1),
            )
        )
    return errors


def silently_wrong(scene: Scene, found: list[Registration]) -> list[int]:
    """Return the frames called reliable that are wrong relative to their nearest reliable one.

    That is the relation that was searched for; over a chain right steps may add up to a drift,
    which the joint solve takes out.
    """
    reliable = [k for k, r in enumerate(found) if r.reliable]
    return [k for j, k in pairwise(reliable) if not pose_errors(scene, found, j)[k].right]
