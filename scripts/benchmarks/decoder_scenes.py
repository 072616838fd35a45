"""Path-traced photographs of the coded grid with exact coordinates: the decoder's test scenes.

The pattern is the package's default, whose code never occurs in training; no rabbit does either.
The seeds of shapes, poses and noise are the benchmark's own.
"""

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.capture.effects import apply_effects
from mitsuba_endo.capture.photograph import photograph
from mitsuba_endo.capture.settings import CaptureSettings, Effects, Light, Tissue
from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel, projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.synthetic import MeshScene
from mitsuba_endo.shapes import Mesh, make_shape

PATTERN = CodedGrid()
SIZE = (PATTERN.width, PATTERN.height)
Kind = Literal["sheet", "sphere", "rabbit", "stomach", "colon"]
KINDS: tuple[Kind, ...] = ("sheet", "sphere", "rabbit", "stomach", "colon")
FOCAL = 300.0
VISIBLE = 0.01
"""Share of full scale, linear and before noise, that the lines must reach within a period for a
pixel to count as lit."""
PERIOD_PX = 15
"""Side of the square in which that is looked for, camera pixels."""
MIXED = 0.25
"""Periods per pixel; where coordinates change faster, a pixel sees several places."""
BRIGHT = 99.5


@dataclass(frozen=True, eq=False)
class Shot:
    """One set-up, photographed without camera effects."""

    camera: CameraModel
    world_from_camera: RigidTransform
    projector_from_camera: RigidTransform
    laser: NDArray[np.float32]
    """(H, W, 3) radiance."""
    glints: NDArray[np.float32]
    """(H, W, 3) radiance of the lamp's reflections from the wet film, at any scale."""
    q: NDArray[np.float64]
    """(H, W, 2) exact coordinates, pattern pixels, also beyond the pattern; NaN = in shadow."""

    def image(self, heavy: bool, seed: int) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """Return the camera's image (H, W, 3) and the pixels (H, W) that count as lit.

        Heavy: speckle of contrast 0.5 to 0.8, glints that saturate 5 to 8 % of the pixels lit by
        the pattern, and an exposure of 0.3 to 0.5 of the one that uses the camera's full scale.
        """
        rng = np.random.default_rng((seed, 5))
        contrast, share, exposure = rng.uniform([0.5, 0.05, 0.3], [0.8, 0.08, 0.5])
        gain = (exposure if heavy else 1.0) / float(np.percentile(self.laser.max(-1), BRIGHT))
        effects = Effects(
            speckle_contrast=contrast if heavy else 0.0, auto_exposure=False, exposure=gain
        )
        radiance = self.laser
        if heavy:
            radiance = radiance + self._strength(share, gain) * self.glints
        image = apply_effects(radiance, effects, seed, laser=self.laser)
        assert image.dtype == np.uint8
        around = np.ones((PERIOD_PX, PERIOD_PX), np.uint8)
        bright = cv2.dilate(self.laser.max(-1) * gain, around) > VISIBLE
        return np.asarray(image, np.uint8), np.asarray(bright, bool)

    def _strength(self, share: float, gain: float) -> float:
        """Return the factor on the glints that saturates this share of the lit pixels, alone."""
        lit = self.lattice_known
        effects = Effects(speckle_contrast=0, shot=None, auto_exposure=False, exposure=gain)
        low, high = 1e-6, 1e6
        for _ in range(24):
            middle = (low * high) ** 0.5
            full = (apply_effects(middle * self.glints, effects, 0) == 255).all(-1)
            low, high = (low, middle) if full[lit].mean() > share else (middle, high)
        return low

    @property
    def lattice_known(self) -> NDArray[np.bool_]:
        """(H, W) pixels that a line of the pattern may light: seen by camera and projector."""
        return np.isfinite(PATTERN.truth(self.q).lattice[..., 0])


def projector() -> ProjectorModel:
    return projector_model("direction_cosine", FOCAL, (239.5, 191.5))


def camera(rng: np.random.Generator, width: int = 480, height: int = 360) -> CameraModel:
    """Return an endoscope's camera with a barrel distortion, 8 to 12 pixels a period."""
    f = rng.uniform(0.5, 0.62) * width
    centre = [0.5 * width + rng.uniform(-4, 4), 0.5 * height + rng.uniform(-4, 4)]
    K = np.array([[f, 0, centre[0]], [0, f * 1.01, centre[1]], [0, 0, 1]])
    return CameraModel("opencv", width, height, K, (-0.14, 0.02, 0.0, 0.0))


def surface(kind: Kind, seed: int) -> Mesh:
    """Return a surface, mm, before a camera at the origin that looks along z."""
    u = np.random.default_rng((seed, 1)).uniform
    if kind == "sheet":
        return make_shape(
            "bumpy_sheet", width=150.0, height=150.0, radius=u(120, 200), ripple_depth=u(2, 4),
            ripple_x=u(8, 14), ripple_y=u(8, 14), dent_depth=u(-7, 7),
        )  # fmt: skip
    if kind == "sphere":
        return make_shape("concave_sphere", radius=u(50, 75), angle_x=1.2, angle_y=1.2)
    if kind == "rabbit":
        return make_shape("rabbit")
    return make_shape(kind, seed=90_000 + seed)


def shoot(kind: Kind, seed: int, *, spp: int = 32, size: tuple[int, int] = (480, 360)) -> Shot:
    """Photograph a surface of this kind from a place drawn with the seed."""
    rng = np.random.default_rng((seed, 2))
    # The rabbit is small: go near.
    near = 20.0 if kind == "rabbit" else rng.uniform(-3, 6)
    at = RigidTransform.of(rng.normal(0, 0.06, 3), [*rng.normal(0, 1.5, 2), near])
    own = RigidTransform.of(
        np.array([0.03, -0.1, 0.05]) + rng.normal(0, 0.03, 3),
        np.array([-5.8, 1.2, 1.6]) + rng.normal(0, 0.4, 3),
    )
    return photograph_at(surface(kind, seed), camera(rng, *size), at, own, seed, spp)


def photograph_at(
    mesh: Mesh,
    camera: CameraModel,
    world_from_camera: RigidTransform,
    projector_from_camera: RigidTransform,
    seed: int,
    spp: int,
) -> Shot:
    """Photograph a mesh from a given place."""
    place = (camera, world_from_camera, projector(), projector_from_camera)
    tissue = Tissue(seed=seed)
    lit = photograph(mesh, *place, PATTERN.image(), CaptureSettings(tissue=tissue, spp=spp), seed,
                     pattern_size=SIZE)  # fmt: skip
    # Nothing but the film's own reflection.
    film = {"base_color": (0.0, 0.0, 0.0), "specular": 0.0, "clearcoat": 1.0,
            "clearcoat_gloss": 0.97, "subsurface": "none"}  # fmt: skip
    wet = tissue.model_copy(update=film)
    settings = CaptureSettings(tissue=wet, light=Light(lamp=1.0), spp=max(1, spp // 2), max_depth=2)
    lamp = photograph(mesh, *place, PATTERN.image(), settings, seed, pattern_size=SIZE)
    q = MeshScene(mesh.vertices, mesh.faces).view(*place).q
    # Wet mucosa is smoother than the material's smoothest film: a lobe cubed is a narrower one,
    # whose highlights have borders instead of a veil over all the image.
    glints = np.maximum(lamp.radiance - lamp.laser, 0) ** 3
    return Shot(camera, world_from_camera, projector_from_camera, lit.laser, glints, q)


@dataclass(frozen=True, eq=False)
class Errors:
    """A decoded image against the truth."""

    error: NDArray[np.float64]
    """(K, 2) of the decoded lit pixels, absolute, grid periods per axis."""
    far: NDArray[np.bool_]
    """(K,) pixels more than a period from any depth edge."""
    lit: int
    """Pixels lit, unshadowed and not mixed."""

    @property
    def coverage(self) -> float:
        return len(self.error) / max(self.lit, 1)


def compare(q: NDArray[np.floating], shot: Shot, visible: NDArray[np.bool_]) -> Errors:
    """Compare decoded coordinates (H, W, 2) with the truth where that is defined."""
    step = _largest_step(shot.q / PATTERN.period)
    judged = shot.lattice_known & (step < MIXED) & visible
    # A shadow's border is a depth edge too; that of the pattern is none.
    away = cv2.distanceTransform((step < MIXED).astype(np.uint8), cv2.DIST_L2, 5)
    far = away > 1 / float(np.median(step[judged]))
    found = judged & np.isfinite(q[..., 0])
    return Errors(np.abs(q - shot.q)[found] / PATTERN.period, far[found], int(judged.sum()))


def _largest_step(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest change (H, W) to any of four neighbours; infinite beside and at NaN."""
    step = np.where(np.isfinite(q[..., 0]), 0, np.inf)
    for axis in (0, 1):
        change = np.nan_to_num(np.abs(np.diff(q, axis=axis)).max(-1), nan=np.inf)
        before = tuple(slice(-1) if k == axis else slice(None) for k in (0, 1))
        after = tuple(slice(1, None) if k == axis else slice(None) for k in (0, 1))
        step[before] = np.maximum(step[before], change)
        step[after] = np.maximum(step[after], change)
    return step
