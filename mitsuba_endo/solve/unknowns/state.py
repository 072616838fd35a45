"""The values of all unknowns at one moment of the optimisation."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...geometry.projection_models import ProjectorModel, projector_model
from ...geometry.transforms import RigidTransform
from ...rendering.projector_coordinates import FrameModel
from .block import BLOCKS, Value


@dataclass(frozen=True, eq=False)
class State:
    """Current values; lengths are in baselines.

    A value that frames share exists once, so it cannot differ between them.
    """

    surfaces: tuple[NDArray[np.float64], ...]
    """One value a vertex (V,), of every surface."""
    values: Mapping[str, tuple[Value, ...]]
    """Of every block, one for each owner."""
    owners: Mapping[str, tuple[int, ...]]
    """Of every block, which value each frame has."""

    def at(self, block: str, frame: int) -> Any:
        """Return a frame's value of a block."""
        return self.values[block][self.owners[block][frame]]

    def with_surfaces(self, *surfaces: NDArray[np.float64]) -> "State":
        """Return the state with other values of all surfaces."""
        return replace(self, surfaces=surfaces)

    def with_value(self, block: str, owner: int, value: Value) -> "State":
        """Return the state with one value replaced."""
        values = list(self.values[block])
        values[owner] = value
        return replace(self, values={**self.values, block: tuple(values)})

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(next(iter(self.owners.values())))

    @property
    def camera_poses(self) -> list[RigidTransform]:
        """world_from_camera of every frame."""
        return [self.at("camera_pose", k) for k in range(self.frames)]

    @property
    def projector_poses(self) -> list[RigidTransform]:
        """projector_from_camera of every frame."""
        return [self.at("projector_pose", k) for k in range(self.frames)]

    @property
    def focals(self) -> list[float]:
        """Focal length of the projector in every frame, pattern pixels."""
        return [float(np.exp(self.at("focal", k)[0])) for k in range(self.frames)]

    def frame_model(self, frame: int, camera: CameraModel, law: str) -> FrameModel:
        """Return camera and projector of a frame as plain numbers.

        Args:
            frame: its index.
            camera: as the rig gives it.
            law: name of the projector's projection model.
        """
        model = blank_model(camera, law)
        for name, block in BLOCKS.items():
            value = self.at(name, frame)
            if not block.holds(model, value):
                plain = value if isinstance(value, RigidTransform) else [float(v) for v in value]
                model = block.attach(model, plain)
        return model

    def projector(self, frame: int, camera: CameraModel, law: str) -> ProjectorModel | None:
        """Return the projector of a frame, None where some unknown makes it more than a model."""
        model = self.frame_model(frame, camera, law).projector
        return model if isinstance(model, ProjectorModel) else None


def blank_model(camera: CameraModel, law: str) -> FrameModel:
    """Return the model of a frame before any block has put its value in."""
    here = RigidTransform.identity()
    return FrameModel(camera, here, here, projector_model(law, 1.0, (0.0, 0.0)))
