"""A closed, folded lumen seen by an endoscope that is withdrawn, with its truth.

The surface is the colon of :mod:`mitsuba_endo.shapes`, closed at its far end, around all cameras;
rays are Mitsuba's. The world is the first camera's frame. It looks deepest; what lies beside and
behind it only later frames see, and no function of the direction from the first camera represents
it all. The camera is a small, non-square, distorted fisheye; the projector's centre is off the
middle of a non-square pattern, and its pose differs a little from frame to frame. Units mm,
radians, pattern pixels.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.rendering.decoder_errors import like_decoded
from mitsuba_endo.shapes import Mesh, make_shape
from tests.solve.views import Views

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SIZE = (560, 472)
CENTRE = (286.0, 229.0)
FOCAL = 300.0
POSE = RigidTransform.of([0.02, 0.08, 0.05], [-5.3, 1.2, 0.8])
"""projector_from_camera of the first frame: a baseline of 5.5 mm, turned to meet the view."""
WITHDRAWAL = 8.0
"""From frame to frame, mm."""
REACH = 65.0
"""Range beyond which too little light returns, mm."""


@dataclass(frozen=True, eq=False)
class Lumen(Views):
    """Views of a closed lumen: :attr:`maps` is what a solver is given, the rest is truth."""

    mesh: Mesh
    """The true surface, world."""
    size: ClassVar[tuple[float, float]] = SIZE
    centre: ClassVar[tuple[float, float]] = CENTRE

    @property
    def ranges(self) -> list[Floats]:
        """(H, W) a frame, mm along the unit ray; NaN without a correspondence."""
        valid = [m.valid for m in self.maps]
        ranges = [np.linalg.norm(p, axis=-1) for p in self.points]
        return [np.where(v, r, np.nan) for v, r in zip(valid, ranges, strict=True)]

    @cached_property
    def seen(self) -> Bools:
        """(frames, V) which vertices of :attr:`mesh` have a correspondence in which frame."""
        from mitsuba_endo.rendering.synthetic import MeshScene

        scene = MeshScene(self.mesh.vertices, self.mesh.faces)
        return np.stack([self._sees(k, scene) for k in range(len(self.maps))])

    @property
    def hidden_from_first(self) -> Bools:
        """(V,) vertices that the first frame does not see, but another does."""
        return ~self.seen[0] & self.seen[1:].any(0)

    def completeness(
        self, vertices: Floats, faces: NDArray[np.int64], of: Bools, within: float = 1.0
    ) -> float:
        """Return the share of the true surface ``of`` (V,) that a surface comes near to.

        Args:
            vertices: (N, 3) of the surface, world, mm.
            faces: (F, 3) of the surface.
            of: which true vertices count, by their :attr:`areas`.
            within: what is near, mm.
        """
        near = distance_to_mesh(self.mesh.vertices[of], vertices, faces) <= within
        return float(np.average(near, weights=self.areas[of]))

    @cached_property
    def areas(self) -> Floats:
        """(V,) a third of the faces around each vertex, mm^2."""
        corners = self.mesh.vertices[self.mesh.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        share = np.linalg.norm(normals, axis=1) / 6
        return np.bincount(self.mesh.faces.ravel(), share.repeat(3), len(self.mesh.vertices))

    def _sees(self, k: int, scene: object) -> Bools:
        """Tell which vertices frame k's camera sees, its projector lights and its map holds."""
        world_from_camera, own = self.world_from_camera[k], self.projector_from_camera[k]
        at = world_from_camera.inverse().apply(self.mesh.vertices)
        uv = np.round(self.camera.project(at))
        size = (self.camera.width, self.camera.height)
        inside = ((uv >= 0) & (uv < size)).all(1) & (at[:, 2] > -0.5 * np.linalg.norm(at, axis=1))
        u, v = np.where(inside[:, None], uv, 0).astype(int).T
        held = inside & self.maps[k].valid[v, u]
        origins = (world_from_camera.t, (world_from_camera @ own.inverse()).t)
        return held & np.logical_and.reduce(
            [scene.reaches(origin, self.mesh.vertices) for origin in origins]  # type: ignore[attr-defined]
        )


def endoscope(width: int = 132, height: int = 104) -> CameraModel:
    """A fisheye of about 112 degrees across whose two axes differ in everything."""
    K = np.array([[0.51 * width, 0, 0.48 * width], [0, 0.65 * height, 0.53 * height], [0, 0, 1]])
    return CameraModel("opencv_fisheye", width, height, K, (0.02, -0.006, 0.001, -0.0005))


def colon(seed: int = 4, behind: float = 62.0) -> Mesh:
    """A segment of 22 mm radius with folds of 6 mm, bent and closed 45 mm before the origin."""
    return make_shape(
        "colon", length=24.0, behind=behind, radius=22.0, bend=0.28, bend_towards=0.6,
        fold_depth=6.0, fold_spacing=19.0, fold_width=3.0, tenia_depth=1.5, edge=1.0, seed=seed,
    )  # fmt: skip


def withdrawal(count: int, rng: np.random.Generator) -> list[RigidTransform]:
    """Camera poses drawn back by 8 mm each, a millimetre off the axis and three degrees turned."""
    moved = [
        RigidTransform.of(
            rng.normal(0, 0.05, 3), [*rng.normal(0, 1.2, 2), -WITHDRAWAL * k + rng.normal(0, 0.3)]
        )
        for k in range(1, count)
    ]
    return [RigidTransform.identity(), *moved]


def projector_poses(count: int, rng: np.random.Generator) -> list[RigidTransform]:
    """A projector that moves in its channel by some 0.2 mm and a degree from frame to frame."""
    moved = [
        POSE.perturbed(np.concatenate([rng.normal(0, 0.015, 3), rng.normal(0, 0.2, 3)]))
        for _ in range(1, count)
    ]
    return [POSE, *moved]


def withdrawn(
    count: int = 6,
    *,
    mesh: Mesh | None = None,
    camera: CameraModel | None = None,
    law: str = "direction_cosine",
    noise: float = 0.3,
    outliers: float = 0.0,
    seed: int = 0,
) -> Lumen:
    """Withdraw the endoscope through a lumen in ``count`` frames.

    Args:
        count: frames; the default mesh has room for 7.
        mesh: the lumen, around all cameras; the default is :func:`colon`.
        camera: the default is :func:`endoscope`.
        law: of the projector.
        noise: standard deviation of each coordinate, pattern pixels; white.
        outliers: share of the correspondences that is uniform over the pattern.
        seed: of poses and noise.
    """
    backend.use("llvm_ad_rgb")
    from mitsuba_endo.rendering.synthetic import MeshScene

    mesh, camera = mesh or colon(), camera or endoscope()
    rng = np.random.default_rng(seed)
    cameras, projectors = withdrawal(count, rng), projector_poses(count, rng)
    projector, scene = projector_model(law, FOCAL, CENTRE), MeshScene(mesh.vertices, mesh.faces)
    maps, points = [], []
    for k, (pose, own) in enumerate(zip(cameras, projectors, strict=True)):
        seen = scene.view(camera, pose, projector, own, SIZE)
        near = np.linalg.norm(seen.points, axis=-1, keepdims=True) < REACH
        q = np.where(near, seen.q, np.nan)
        q = like_decoded(q, SIZE, noise, outliers, seed=1000 * seed + k)
        maps.append(CorrespondenceMap(q, f"frame{k}"))
        points.append(seen.points)
    return Lumen(maps, camera, projector, cameras, projectors, points, mesh)
