"""Poses of camera and projector before a surface: drawn, checked, drawn again."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.cameras import CameraModel
from ..geometry.endoscope import Endoscope
from ..geometry.projection_models import ProjectorModel
from ..rendering.synthetic import MeshScene
from ..shapes.mesh import Mesh
from .config import PoseRules, ProjectorRanges
from .optics import draw_projector_pose
from .scene_ranges import ViewRanges
from .view_sampler import ViewSampler

COARSE = 40
"""Pixels across the small image by which poses are judged: 1,200 rays tell shares to 1 or 2 %."""
FROM_BEHIND = 0.02
"""Largest share of what is seen that may be seen from behind: more means inside the wall."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SampledPoses:
    """An endoscope whose poses fulfil the rules."""

    endoscope: Endoscope
    lit: float
    """Share of the image's pixels that the projector lights, of a coarse image."""
    tries: int
    """Poses drawn, these included."""


@dataclass(frozen=True, eq=False)
class PoseSampler:
    """Draws poses of one camera and projector before one surface."""

    rules: PoseRules
    mesh: Mesh
    scene: MeshScene
    camera: CameraModel
    projector: ProjectorModel
    pattern_size: tuple[int, int]

    def sample(
        self, views: ViewSampler, view: ViewRanges, channel: ProjectorRanges,
        rng: np.random.Generator,
    ) -> SampledPoses:  # fmt: skip
        """Draw poses of camera and projector until they fulfil the rules.

        Raises:
            InputError: none did within the tries; says what was wrong with how many.
        """
        coarse = _coarse(self.camera)
        faults: Counter[str] = Counter()
        for number in range(self.rules.tries):
            camera_pose = views.draw(view, rng, self.scene)
            projector_pose = draw_projector_pose(channel, rng)
            fault, lit = self._judge(Endoscope(coarse, camera_pose, self.projector, projector_pose))
            if fault is None:
                endoscope = Endoscope(self.camera, camera_pose, self.projector, projector_pose)
                return SampledPoses(endoscope, lit, number + 1)
            faults[fault] += 1
        counts = ", ".join(f"{count} with {fault}" for fault, count in faults.most_common())
        raise InputError(
            f"no place for camera and projector in {self.rules.tries} tries ({counts})",
            "placing",
            "widen the scene's view, or relax margin and least_lit",
        )

    def _judge(self, endoscope: Endoscope) -> tuple[str | None, float]:
        """Return what is wrong with its poses, cheapest first, and the share that is lit."""
        camera, projector = endoscope.world_from_camera.t, endoscope.world_from_projector.t
        for name, centre in (("camera", camera), ("projector", projector)):
            if clearance(self.mesh, centre, self.rules.margin) < self.rules.margin:
                return f"the {name} nearer than {self.rules.margin:g} mm to the surface", 0.0
        if self._wall_between(camera, projector):
            return "the surface between camera and projector", 0.0
        hits = self.scene.through_pixels(endoscope.camera, endoscope.world_from_camera)
        if hits.from_behind(camera) > FROM_BEHIND:
            return "the camera behind or inside the surface", 0.0
        view = self.scene.view(endoscope.camera, endoscope.world_from_camera, self.projector,
                               endoscope.projector_from_camera, self.pattern_size)  # fmt: skip
        lit = float(np.isfinite(view.q[..., 0]).mean())
        if lit < self.rules.least_lit:
            return f"less than {100 * self.rules.least_lit:.0f} % of the image lit", lit
        return None, lit

    def _wall_between(self, a: Array, b: Array) -> bool:
        length = float(np.linalg.norm(b - a))
        hits = self.scene.cast(a, (b - a)[None] / length)
        return bool(hits.hit[0]) and float(np.linalg.norm(hits.points[0] - a)) < length


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
    width, height = COARSE, max(2, round(camera.height * (COARSE / camera.width)))
    scale = np.array([width / camera.width, height / camera.height, 1.0])
    K = camera.K * scale[:, None]
    K[:2, 2] += 0.5 * scale[:2] - 0.5  # integer pixels are centres
    return CameraModel(camera.model, width, height, K, camera.distortion)
