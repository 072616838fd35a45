"""Finding a place for camera and projector: drawn, checked, drawn again."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.cameras import CameraModel
from ..geometry.laws import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..rendering.synthetic import MeshScene
from ..shapes.mesh import Mesh
from .config import Placing, View
from .optics import ProjectorDraw
from .stances import Stance

COARSE = 40
"""Pixels across the small image by which a place is judged."""
FROM_BEHIND = 0.02
"""Largest share of what is seen that may be seen from behind: more means inside the wall."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placed:
    """Poses that fulfil the conditions."""

    world_from_camera: RigidTransform
    projector_from_camera: RigidTransform
    lit: float
    """Share of the image's pixels that the projector lights, of a coarse image."""
    tries: int
    """Places drawn, this one included."""


def find_place(
    stance: Stance,
    view: View,
    rules: Placing,
    mesh: Mesh,
    scene: MeshScene,
    camera: CameraModel,
    projector: ProjectorModel,
    pattern_size: tuple[int, int],
    mount: ProjectorDraw,
    rng: np.random.Generator,
) -> Placed:
    """Draw poses of camera and projector until they fulfil the rules.

    Raises:
        InputError: none did within the tries; says what was wrong with how many.
    """
    judge = _Judge(rules, mesh, scene, _coarse(camera), projector, pattern_size)
    faults: Counter[str] = Counter()
    for number in range(rules.tries):
        world_from_camera = stance.place(view, rng, scene)
        projector_from_camera = mount.pose(rng)
        fault, lit = judge.verdict(world_from_camera, projector_from_camera)
        if fault is None:
            return Placed(world_from_camera, projector_from_camera, lit, number + 1)
        faults[fault] += 1
    told = ", ".join(f"{count} with {fault}" for fault, count in faults.most_common())
    raise InputError(
        f"no place for camera and projector in {rules.tries} tries ({told})",
        "placing",
        "widen the scene's view, or relax margin and least_lit",
    )


@dataclass(frozen=True, eq=False)
class _Judge:
    rules: Placing
    mesh: Mesh
    scene: MeshScene
    camera: CameraModel
    projector: ProjectorModel
    pattern_size: tuple[int, int]

    def verdict(
        self, world_from_camera: RigidTransform, projector_from_camera: RigidTransform
    ) -> tuple[str | None, float]:
        """Return what is wrong with two poses, cheapest first, and the share that is lit."""
        world_from_projector = world_from_camera @ projector_from_camera.inverse()
        for name, at in (("camera", world_from_camera.t), ("projector", world_from_projector.t)):
            if clearance(self.mesh, at, self.rules.margin) < self.rules.margin:
                return f"the {name} nearer than {self.rules.margin:g} mm to the surface", 0.0
        if self._wall_between(world_from_camera.t, world_from_projector.t):
            return "the surface between camera and projector", 0.0
        seen = self.scene.through_pixels(self.camera, world_from_camera)
        if seen.from_behind(world_from_camera.t) > FROM_BEHIND:
            return "the camera behind or inside the surface", 0.0
        view = self.scene.view(self.camera, world_from_camera, self.projector,
                               projector_from_camera, self.pattern_size)  # fmt: skip
        lit = float(np.isfinite(view.q[..., 0]).mean())
        if lit < self.rules.least_lit:
            return f"less than {100 * self.rules.least_lit:.0f} % of the image lit", lit
        return None, lit

    def _wall_between(self, a: Array, b: Array) -> bool:
        way = b - a
        length = float(np.linalg.norm(way))
        met = self.scene.cast(a, way[None] / length)
        return bool(met.hit[0]) and float(np.linalg.norm(met.points[0] - a)) < length


def clearance(mesh: Mesh, point: Array, within: float) -> float:
    """Return the distance of a point (3,) from a mesh, mm; infinite beyond ``within``."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    # A face nearer than `within` reaches into the box around the point.
    low = np.minimum(np.minimum(a, b), c) - within
    high = np.maximum(np.maximum(a, b), c) + within
    near = mesh.vertices[mesh.faces[((point >= low) & (point <= high)).all(1)]]
    if not len(near):
        return float("inf")
    closest = trimesh.triangles.closest_point(near, np.tile(point, (len(near), 1)))
    distance = float(np.linalg.norm(closest - point, axis=1).min())
    return distance if distance <= within else float("inf")


def _coarse(camera: CameraModel) -> CameraModel:
    """Return the same view in few pixels."""
    share = COARSE / camera.width
    width, height = COARSE, max(2, round(camera.height * share))
    scale = np.array([width / camera.width, height / camera.height, 1.0])
    K = camera.K * scale[:, None]
    K[:2, 2] += 0.5 * scale[:2] - 0.5  # integer pixels are centres
    return CameraModel(camera.model, width, height, K, camera.distortion)
