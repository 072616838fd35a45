"""Synthetic camera-projector rigs by NumPy ray casting: the tests' truth.

Independent of the renderer: surfaces are analytic, a ray meets them in closed form or by Newton's
method, and the correspondence of a pixel is the projection of that point. Cameras are non-square,
asymmetric and distorted. Units mm, radians, pattern pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel, projector_model
from mitsuba_endo.geometry.transforms import RigidTransform

Surface = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Range of the first hit along unit camera rays (..., 3) from the origin; NaN = miss."""


@dataclass(frozen=True, eq=False)
class Rig:
    """A rig with the exact correspondences of one view, and its truth."""

    camera: CameraModel
    projector: ProjectorModel
    size: tuple[int, int]
    """Pattern width and height, pixels."""
    projector_from_camera: RigidTransform
    q: NDArray[np.float64]
    """(H, W, 2) pattern pixels, NaN where the pattern does not reach."""
    depth: NDArray[np.float64]
    """(H, W) range along the unit camera ray, mm."""

    @property
    def baseline(self) -> float:
        return float(np.linalg.norm(self.projector_from_camera.t))

    @property
    def unknown_projector(self) -> ProjectorModel:
        """The projector with a useless focal length, as a user without a guess would give it."""
        return self.projector.with_(focal=float("nan"))


def plane(normal: tuple[float, float, float], distance: float) -> Surface:
    """The plane through (0, 0, distance) with a normal of any length."""
    n = np.array(normal)

    def hit(rays: NDArray[np.float64]) -> NDArray[np.float64]:
        s = n[2] * distance / (rays @ n)
        return np.where(s > 0, s, np.nan)

    return hit


def sphere(centre: tuple[float, float, float], radius: float) -> Surface:
    """A sphere: seen from outside convex (first hit), from inside concave."""
    c = np.array(centre)

    def hit(rays: NDArray[np.float64]) -> NDArray[np.float64]:
        along = rays @ c
        rest = along**2 - c @ c + radius**2
        root = np.sqrt(np.where(rest >= 0, rest, np.nan))
        near = along - root
        return np.where(near > 0, near, along + root)

    return hit


def bumpy_sheet(distance: float, tilt: tuple[float, float], height: float, seed: int) -> Surface:
    """z = distance + tilt . (x, y) + a sum of waves of about ``height`` mm, by Newton's method."""
    rng = np.random.default_rng(seed)
    k = rng.normal(size=(5, 2)) * 4 / distance
    phase, weight = rng.uniform(0, 2 * np.pi, 5), height * rng.uniform(0.3, 0.7, 5)

    def hit(rays: NDArray[np.float64]) -> NDArray[np.float64]:
        # A ray at right angles to the axis never meets the sheet: start from a bounded range.
        s = distance / np.maximum(rays[..., 2], 0.2)
        for _ in range(30):
            xy = s[..., None] * rays[..., :2]
            angle = xy @ k.T + phase
            gap = s * rays[..., 2] - distance - xy @ np.array(tilt) - np.sin(angle) @ weight
            gradient = np.array(tilt) + (np.cos(angle) * weight) @ k
            slope = rays[..., 2] - (gradient * rays[..., :2]).sum(-1)
            s = s - gap / np.where(np.abs(slope) > 0.1, slope, 0.1)
        return np.where((np.abs(gap) < 1e-9 * distance) & (s > 0), s, np.nan)

    return hit


def lopsided_camera(width: int = 320, height: int = 224) -> CameraModel:
    """A camera of about 56 degrees whose two axes differ in everything."""
    K = np.array([[0.94 * width, 0, 0.47 * width], [0, 0.96 * width, 0.54 * height], [0, 0, 1]])
    return CameraModel("opencv", width, height, K, (-0.12, 0.04, 0.001, -0.0015, 0.0))


def lopsided_fisheye(width: int = 320, height: int = 224) -> CameraModel:
    """A fisheye of about 160 degrees across, such as an endoscope's."""
    K = np.array([[0.34 * width, 0, 0.47 * width], [0, 0.35 * width, 0.53 * height], [0, 0, 1]])
    return CameraModel("opencv_fisheye", width, height, K, (0.02, -0.005, 0.0, 0.0))


def cast(
    camera: CameraModel,
    projector: ProjectorModel,
    size: tuple[int, int],
    projector_from_camera: RigidTransform,
    surface: Surface,
) -> Rig:
    """Return the rig's exact view of ``surface``; shadows of the surface on itself are ignored."""
    rays = camera.rays(camera.pixel_grid())
    depth = surface(rays)
    q = projector.project(projector_from_camera.apply(depth[..., None] * rays))
    with np.errstate(invalid="ignore"):
        lit = (q >= 0).all(-1) & (q <= np.array(size) - 1).all(-1)
    return Rig(
        camera, projector, size, projector_from_camera,
        np.where(lit[..., None], q, np.nan), np.where(lit, depth, np.nan),
    )  # fmt: skip


def random_rig(seed: int, camera: CameraModel | None = None, *, kind: str | None = None) -> Rig:
    """Draw a rig: rotation to 20 degrees, focal 0.5-1.8 pattern widths, both laws.

    The baseline is 5-10 mm at a distance of about 70 mm and up to 25 degrees out of the camera's
    image plane. The projector is aimed by its rotation alone; rigs in which its pattern covers
    less than a quarter of the image are drawn again.

    Args:
        kind: "sheet" or "sphere"; drawn where absent.
    """
    rng = np.random.default_rng(seed)
    camera = camera or lopsided_camera()
    size = (512, 400)
    while True:
        law = str(rng.choice(["pinhole", "direction_cosine"]))
        focal = size[0] * rng.uniform(0.5, 1.8)
        centre = tuple((np.array(size) - 1) * rng.uniform(0.42, 0.58, 2))
        rig = cast(
            camera, projector_model(law, focal, centre, aspect=1.01), size,
            _random_pose(rng), _random_surface(rng, kind),
        )  # fmt: skip
        if np.isfinite(rig.q[..., 0]).mean() > 0.25:
            return rig


def _random_pose(rng: np.random.Generator) -> RigidTransform:
    axis = rng.normal(size=3)
    rotation = axis / np.linalg.norm(axis) * np.radians(rng.uniform(0, 20))
    around, out = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(-25, 25))
    t = [np.cos(out) * np.cos(around), np.cos(out) * np.sin(around), np.sin(out)]
    return RigidTransform.of(rotation, rng.uniform(5, 10) * np.array(t))


def _random_surface(rng: np.random.Generator, kind: str | None) -> Surface:
    kind = kind or str(rng.choice(["sheet", "sphere"]))
    if kind == "sheet":
        tilt = rng.uniform(-0.4, 0.4, 2)
        return bumpy_sheet(
            rng.uniform(60, 80), (tilt[0], tilt[1]), rng.uniform(4, 8), int(rng.integers(1 << 30))
        )
    if rng.random() < 0.5:
        # Concave, from inside near the rim; convex, filling most of the view.
        return sphere((rng.uniform(-8, 8), rng.uniform(-8, 8), rng.uniform(15, 30)), 50)
    return sphere((rng.uniform(-8, 8), rng.uniform(-8, 8), rng.uniform(95, 105)), 45)


def with_noise(rig: Rig, sigma: float, seed: int) -> Rig:
    """Add Gaussian noise of ``sigma`` pattern pixels to each component of q."""
    rng = np.random.default_rng(seed)
    return replace(rig, q=rig.q + sigma * rng.standard_normal(rig.q.shape))


def with_outliers(rig: Rig, share: float, seed: int) -> Rig:
    """Replace a share of the seen correspondences by ones uniform over the pattern."""
    rng = np.random.default_rng(seed)
    hit = np.isfinite(rig.q[..., 0]) & (rng.random(rig.q.shape[:2]) < share)
    random = rng.uniform(0, 1, rig.q.shape) * (np.array(rig.size) - 1)
    return replace(rig, q=np.where(hit[..., None], random, rig.q))


def with_slips(rig: Rig, share: float, period: float, seed: int) -> Rig:
    """Shift discs that cover a share of the seen pixels by one whole grid period along an axis."""
    rng = np.random.default_rng(seed)
    seen = np.isfinite(rig.q[..., 0])
    height, width = seen.shape
    y, x = np.mgrid[:height, :width]
    slipped, shift = np.zeros_like(seen), np.zeros_like(rig.q)
    while slipped[seen].mean() < share:
        cx, cy, radius = (
            rng.uniform(0, width),
            rng.uniform(0, height),
            width * rng.uniform(0.02, 0.05),
        )
        disc = ((x - cx) ** 2 + (y - cy) ** 2 < radius**2) & ~slipped
        shift[disc, rng.integers(2)] = period * rng.choice([-1, 1])
        slipped |= disc
    return replace(rig, q=rig.q + shift)
