"""The gauge: what the world is and what the unit of length is, which no correspondence tells."""

from dataclasses import dataclass

import numpy as np

from ...geometry.transforms import RigidTransform, tangent_basis
from .block import Block, Floats, Value


@dataclass(frozen=True)
class Gauge:
    """Degrees of freedom that are held, because moving them changes no residual."""

    world: int = 0
    """Owner of the camera pose that is the world's origin."""
    unit_lengths: frozenset[int] = frozenset({0})
    """Owners of the projector poses whose translation's length is a unit of length."""

    def is_origin(self, block: str, owner: int) -> bool:
        """Tell whether a value is the world's frame and does not move."""
        return block == "camera_pose" and owner == self.world

    def holds_length(self, block: str, owner: int) -> bool:
        """Tell whether a translation moves on a sphere only."""
        return block == "projector_pose" and owner in self.unit_lengths

    def tangent_map(self, block: str, owner: int, value: Value, width: int) -> Floats:
        """Return T (width, unknowns) from steps of the unknowns to steps of the value.

        Where a length is held, the translation has two components, perpendicular to it.
        """
        if not self.holds_length(block, owner):
            return np.eye(width)
        T = np.zeros((6, 5))
        T[:3, :3] = np.eye(3)
        T[3:, 3:] = tangent_basis(value.t)
        return T

    def retract(self, block: Block, owner: int, value: Value, step: Floats) -> Value:
        """Return the value moved by a step (width,), a held length restored."""
        moved = block.retract(value, step)
        if not self.holds_length(block.name, owner):
            return moved
        return RigidTransform(
            moved.R, moved.t * (np.linalg.norm(value.t) / np.linalg.norm(moved.t))
        )

    def names(self, block: str, owner: int, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return what people call the unknowns of a value whose components have ``names``."""
        if not self.holds_length(block, owner):
            return names
        return (*names[:3], "translation direction 1", "translation direction 2")
