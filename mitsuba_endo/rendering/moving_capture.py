"""A scene that an endoscope moves through: exact maps and poses of every frame."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.endoscope import Endoscope
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..records.ground_truth import GroundTruth, TrueFrame
from .decoder_errors import like_decoded
from .scene import LoadedScene
from .synthetic import MeshScene

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MovingCapture:
    """A scene with the way of its camera and projector."""

    loaded: LoadedScene
    """Its own camera is the first one's place, its projector where that one begins."""
    first_from_camera: list[RigidTransform]
    """Of every frame, mm."""
    projector_moved: list[RigidTransform]
    """What the projector has moved by, in its own axes: projector_from_camera of a frame is this
    times that of the scene."""
    noise: float = 0.0
    """Of each coordinate, white; pattern pixels."""
    nothing: range = range(0)
    """Frames that show nothing."""
    seed: int = 0

    def __len__(self) -> int:
        return len(self.first_from_camera)

    @staticmethod
    def name(k: int) -> str:
        """Return the name of a frame."""
        return f"frame{k:04d}"

    def world_from_camera(self, k: int) -> RigidTransform:
        """Return a camera's place in the scene."""
        return self._place @ self.first_from_camera[k]

    def projector_from_camera(self, k: int) -> RigidTransform:
        """Return a frame's pose of the projector."""
        first = self.loaded.world_from_projector().inverse() @ self._place
        return self.projector_moved[k] @ first

    def map(self, k: int) -> NDArray[np.float32]:
        """Return a frame's coordinates (H, W, 2), with noise; NaN = missing."""
        if k in self.nothing:
            camera = self._camera
            return np.full((camera.height, camera.width, 2), np.nan, np.float32)
        size = self.loaded.pattern_size()
        q = self._scene.view(
            self._camera, self.world_from_camera(k), self._projector,
            self.projector_from_camera(k), size,
        ).q  # fmt: skip
        return like_decoded(q, size, self.noise, 0.0, 1000 * self.seed + k)

    def truth(self) -> GroundTruth:
        """Return the exact values of all frames; the world is the first camera."""
        frames = [
            TrueFrame(
                self.name(k),
                Endoscope(
                    self._camera,
                    self.first_from_camera[k],
                    self._projector,
                    self.projector_from_camera(k),
                ),
            )
            for k in range(len(self))
        ]
        return GroundTruth(frames, self.loaded.pattern_size())

    def surface(self) -> tuple[Floats, NDArray[np.int64]]:
        """Return vertices (V, 3) in the first camera's frame, mm, and faces (F, 3)."""
        mesh = self.loaded.surface()
        return self._place.inverse().apply(np.asarray(mesh.vertices, np.float64)), mesh.faces

    @cached_property
    def _place(self) -> RigidTransform:
        return self.loaded.world_from_camera()

    @cached_property
    def _camera(self) -> CameraModel:
        return self.loaded.camera()

    @cached_property
    def _projector(self) -> ProjectorModel:
        return self.loaded.projector()

    @cached_property
    def _scene(self) -> MeshScene:
        mesh = self.loaded.surface()
        return MeshScene(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64))
