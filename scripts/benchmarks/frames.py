"""The prototype's scene with a moving camera and projector: frames that share one sheet."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale
from mitsuba_endo.rendering.synthetic import MeshScene
from mitsuba_endo.shapes import make_shape

from .scene import NOISE_PX, OUTLIER_PX, TRUE_FOCAL, WRONG_FOCAL

SIZE, CENTRE = (512, 512), (255.5, 255.5)
WIDTH_MM = 126.0
"""Of the sheet, larger than one camera sees."""


@dataclass(frozen=True, eq=False)
class Frames:
    """What a solver sees, and apart from it the truth."""

    maps: list[CorrespondenceMap]
    rig: Rig
    camera: CameraModel
    world_from_camera: list[RigidTransform]
    projector_from_camera: list[RigidTransform]

    @property
    def baselines(self) -> NDArray[np.float64]:
        """(K,) mm."""
        return np.array([float(np.linalg.norm(p.t)) for p in self.projector_from_camera])


def make_frames(
    count: int, seed: int, *, pixels: int = 240, outliers: float = 0.02, slips: float = 0.0
) -> Frames:
    """Capture the sheet ``count`` times from places some 10 mm and 5 degrees apart.

    Every frame has a projector pose of its own. ``slips`` is the share of pixels in patches that
    are off by one grid period.
    """
    rng = np.random.default_rng(seed)
    f = 200.0 * pixels / 240
    middle = (pixels - 1) / 2
    camera = CameraModel(
        "opencv", pixels, pixels, np.array([[f, 0, middle], [0, f, middle], [0, 0, 1]])
    )
    at = [RigidTransform.identity()]
    at += [
        RigidTransform.of(rng.normal(0, 0.08, 3), [*rng.normal(0, 7, 2), rng.normal(0, 3)])
        for _ in range(count - 1)
    ]
    turn, shift = np.array([0.03, -0.12, 0.05]), np.array([-6.0, 1.0, 1.5])
    own = [RigidTransform.of(turn, shift)]
    own += [
        RigidTransform.of(turn + rng.normal(0, 0.02, 3), shift + rng.normal(0, 0.4, 3))
        for _ in range(count - 1)
    ]
    sheet = make_shape("bumpy_sheet", width=WIDTH_MM, height=WIDTH_MM)
    scene, projector = (
        MeshScene(sheet.vertices, sheet.faces),
        projector_model("pinhole", TRUE_FOCAL, CENTRE),
    )
    maps = []
    for k in range(count):
        q = scene.view(camera, at[k], projector, own[k]).q
        q = slipped(corrupted(q, outliers, rng), slips, rng)
        maps.append(CorrespondenceMap(q.astype(np.float32), f"frame {k}"))
    rig = Rig(
        camera=Camera.from_model(camera),
        projector=Projector(
            law="pinhole", width=SIZE[0], height=SIZE[1], focal=Focal(value=WRONG_FOCAL)
        ),
        scale=Scale(baseline=float(np.linalg.norm(shift))),
    )
    return Frames(maps, rig, camera, at, own)


def corrupted(
    q: NDArray[np.float64], outliers: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Add noise to all, and gross errors to a share of the correspondences."""
    q = q + NOISE_PX * rng.standard_normal(q.shape)
    gross = rng.random(q.shape[:2]) < outliers
    q[gross] += OUTLIER_PX * rng.standard_normal((int(gross.sum()), 2))
    return q


def slipped(
    q: NDArray[np.float64], share: float, rng: np.random.Generator, period: float = 16.0
) -> NDArray[np.float64]:
    """Shift discs that cover a share of the image by one grid period along an axis."""
    height, width = q.shape[:2]
    y, x = np.mgrid[:height, :width]
    done = np.zeros((height, width), bool)
    q = q.copy()
    while done.mean() < share:
        centre, radius = rng.uniform(0, [width, height]), width * rng.uniform(0.02, 0.06)
        disc = ((x - centre[0]) ** 2 + (y - centre[1]) ** 2 < radius**2) & ~done
        q[disc, rng.integers(2)] += period * rng.choice([-1, 1])
        done |= disc
    return q


def sheet_distances(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance (N,) of points from the true sheet along its normal, mm."""
    from scipy.spatial import cKDTree

    sheet = make_shape("bumpy_sheet", width=WIDTH_MM, height=WIDTH_MM, edge=0.25)
    normals = np.asarray(sheet.to_trimesh().vertex_normals)
    _, nearest = cKDTree(sheet.vertices).query(points)
    return np.einsum("ni,ni->n", points - sheet.vertices[nearest], normals[nearest])
