"""The prototype's scene: a bumpy sheet 70 mm away, seen by a camera beside a projector.

80 mm sheet, projector f = 300 px and baseline 6.27 mm, 240 x 240 = 57,600 correspondences (every
second pixel of a 480 x 480 camera) with 0.3 px noise and 2 % gross outliers of 30 px. The truth is
kept apart from the rig, which is all that a solver gets.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale
from mitsuba_endo.shapes.bumpy_sheet import BumpySheet

TRUE_FOCAL = 300.0
WRONG_FOCAL = 270.0
"""Ten per cent off: the guess that every solver gets."""
NOISE_PX = 0.3
OUTLIERS = 0.02
OUTLIER_PX = 30.0
PLANE_MM = 70.0
"""Distance of the plane from which solvers without a start of their own begin."""
PATTERN = (640, 520)
CENTRE = (360.0, 262.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """A synthetic capture: what a solver sees, and apart from it the truth."""

    map: CorrespondenceMap
    rig: Rig
    true_pose: RigidTransform
    """projector_from_camera, mm."""
    true_range: NDArray[np.float64]
    """(H, W) along the unit camera rays, mm."""
    gross: NDArray[np.bool_]
    """(H, W) correspondences that are gross outliers."""

    @property
    def camera(self) -> CameraModel:
        return self.rig.camera.to_model()

    @property
    def baseline(self) -> float:
        return float(np.linalg.norm(self.true_pose.t))


def make_scene(width: int = 240, height: int = 240, seed: int = 0) -> Scene:
    """Cast the rays of a ``width`` x ``height`` camera, 62 degrees wide, onto the sheet."""
    pixel = 480 / width
    K = [[400 / pixel, 0, (width - 1) / 2], [0, 400 / pixel, (height - 1) / 2], [0, 0, 1]]
    camera = Camera(width=width, height=height, K=K)
    model = camera.to_model()
    rays = model.grid_rays
    distance = cast(BumpySheet(), rays)
    pose = RigidTransform.of([0.03, -0.12, 0.05], [-6.0, 1.0, 1.5])
    law = projector_model("pinhole", TRUE_FOCAL, CENTRE)
    q, gross = _corrupted(law.project(pose.apply(distance[..., None] * rays)), seed)
    rig = Rig(
        camera=camera,
        projector=Projector(
            law="pinhole", width=PATTERN[0], height=PATTERN[1],
            focal=Focal(value=WRONG_FOCAL), centre=list(CENTRE),
        ),
        scale=Scale(baseline=float(np.linalg.norm(pose.t))),
    )  # fmt: skip
    return Scene(CorrespondenceMap(q.astype(np.float32), "sheet.npz"), rig, pose, distance, gross)


def cast(sheet: BumpySheet, rays: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the range along unit rays (..., 3) at which they meet the sheet, mm, by bisection.

    NaN where a ray passes beside the sheet.
    """
    x, y = rays[..., 0], rays[..., 1]
    relief = sheet.ripple_depth + abs(sheet.dent_depth)
    far = (sheet.distance + relief) / rays[..., 2]
    # The bowl's formula ends at its radius; rays that leave it earlier miss the sheet.
    far = np.minimum(far, 0.999 * sheet.radius / np.maximum(np.hypot(x, y), 1e-12))
    near = np.zeros_like(far)
    for _ in range(60):
        middle = (near + far) / 2
        behind = middle * rays[..., 2] > sheet.depth(middle * x, middle * y)
        near, far = np.where(behind, near, middle), np.where(behind, middle, far)
    half = np.array([sheet.width, sheet.height]) / 2
    hit = (np.abs(far[..., None] * rays[..., :2]) <= half).all(-1)
    return np.where(hit, far, np.nan)


def _corrupted(q: NDArray[np.float64], seed: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    rng = np.random.default_rng(seed)
    gross = rng.random(q.shape[:2]) < OUTLIERS
    noisy = q + NOISE_PX * rng.standard_normal(q.shape)
    far = OUTLIER_PX * rng.standard_normal(q.shape)
    return noisy + np.where(gross[..., None], far, 0.0), gross
