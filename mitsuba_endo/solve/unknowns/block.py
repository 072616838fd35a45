"""A block: one kind of unknown, with everything that is particular to it.

A block owns its name, its value and how a step changes it, how it enters the rendering of a frame,
what the rig says of it, its natural scale, its words and its learning rate. What is shared by all
blocks (who has which value, where it stands in the vector of unknowns) is in :mod:`.layout`.

To add an unknown, write one file in this package with a class under ``@register_block``.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...geometry.transforms import RigidTransform, rotation_from_vector
from ...records.rig import Rig, Sharing, register_sharing
from ...rendering.projector_coordinates import FrameModel

Value = Any
"""What a block holds: a :class:`RigidTransform`, or an array (n,)."""
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class NaturalScales:
    """Sizes of a scene, by which errors of the unknowns are judged."""

    distance: float
    """Median range of the surface, baselines."""
    focal: float
    """Focal length of the projector, pattern pixels."""
    camera_focal: float
    """Focal length of the camera, pixels."""


@dataclass(frozen=True, eq=False)
class Suspect:
    """One way in which a given value may be wrong."""

    part: str
    """Of the block, a key; empty where the block has only one."""
    words: str
    step: Floats
    """(width,) step of the value that mends it by one unit."""
    unit: str


class Block(ABC):
    """One kind of unknown."""

    name: ClassVar[str]
    """Key of the rig file's ``share``."""
    words: ClassVar[str]
    """For people, e.g. ``focal length``."""
    unit: ClassVar[str] = ""
    """Of the value in reports."""
    default_sharing: ClassVar[Sharing] = "fixed"
    modes: ClassVar[tuple[Sharing, ...]] = ("fixed", "shared", "per_frame")
    """How frames may have it."""
    order: ClassVar[int] = 100
    """Blocks with a lower number stand and are applied before others."""

    @abstractmethod
    def given(self, rig: Rig) -> Value | None:
        """Return the value that the rig gives, or None if it gives none."""

    @abstractmethod
    def names(self, rig: Rig) -> tuple[str, ...]:
        """Return what people call the components of a step; an only one may have no name."""

    @abstractmethod
    def retract(self, value: Value, step: Floats) -> Value:
        """Return the value moved by a step (width,)."""

    @abstractmethod
    def difference(self, value: Value, other: Value) -> Floats:
        """Return the step (width,) from ``value`` to ``other``."""

    @abstractmethod
    def mean(self, values: Sequence[Value]) -> Value:
        """Return one value for frames that came to their own ones."""

    @abstractmethod
    def attach(self, model: FrameModel, value: Any) -> FrameModel:
        """Return the model of a frame with this block's value in it.

        Args:
            model: of the frame.
            value: a :class:`RigidTransform`, or a ``Pose`` of ``rendering.projector_coordinates``,
                or a list of components, of NumPy or of Dr.Jit.
        """

    def holds(self, model: FrameModel, value: Value) -> bool:
        """Tell whether a model holds a value already, so that it need not be attached."""
        return False

    @abstractmethod
    def scales(self, value: Value, scene: NaturalScales) -> Floats:
        """Return the change (width,) of every component that spoils a measurement."""

    @abstractmethod
    def rates(self, value: Value) -> Floats:
        """Return the first learning rates (width,) of first-order solvers."""

    def prior_std(self, rig: Rig, value: Value) -> Floats | None:
        """Return the standard deviations (width,) with which the rig knows the value, or None."""
        return None

    def doubt(self, rig: Rig, value: Value) -> Floats | None:
        """Return the square-root information (m, width) of what is given but seldom exact.

        By the rig's own deviations, else by those of careful calibrations; None where a wrong
        value is no error of a calibration but a mistake.
        """
        return None

    def suspects(self, names: Sequence[str]) -> list["Suspect"]:
        """Return the ways in which a value that is given may be wrong."""
        return [
            Suspect(part, f"{self.words} ({part})" if part else self.words, step, self.unit)
            for part, step in zip(names, np.eye(len(names)), strict=True)
        ]

    def sharing(self, rig: Rig) -> Sharing:
        """Return the mode that the rig asks for."""
        return rig.share.of(self.name) or self.default_sharing


class VectorBlock(Block):
    """An unknown whose value is an array (n,) and whose steps add up."""

    part_names: ClassVar[tuple[str, ...]] = ("",)
    rate: ClassVar[float] = 1e-3

    def names(self, rig: Rig) -> tuple[str, ...]:
        given = self.given(rig)
        return self.part_names if given is None else self.part_names[: len(given)]

    def retract(self, value: Value, step: Floats) -> Value:
        return value + step

    def difference(self, value: Value, other: Value) -> Floats:
        return other - value

    def mean(self, values: Sequence[Value]) -> Value:
        """Return the median, which one bad frame does not sway."""
        return np.median(np.array(values), axis=0)

    def scales(self, value: Value, scene: NaturalScales) -> Floats:
        return np.ones(len(value))

    def rates(self, value: Value) -> Floats:
        return np.full(len(value), self.rate)

    def reported(self, value: Value) -> Floats:
        """Return the value as results give it, e.g. a focal length for its logarithm."""
        return value

    def reported_slope(self, value: Value) -> Floats:
        """Return the derivative (n,) of the reported value."""
        return np.ones(len(value))


class LogarithmBlock(VectorBlock):
    """Positive numbers by their logarithms, which keeps them positive and makes steps relative."""

    def reported(self, value: Value) -> Floats:
        # Twelve digits: a given value comes back as given in spite of its logarithm.
        return np.array([float(f"{v:.12g}") for v in np.exp(value)])

    def reported_slope(self, value: Value) -> Floats:
        return np.exp(value)

    def suspects(self, names: Sequence[str]) -> list[Suspect]:
        suspects = super().suspects(names)
        return [replace(s, step=0.01 * s.step, unit="%") for s in suspects]


class PoseBlock(Block):
    """A rigid transform; a step (w, dt) leads to (exp([w]x) R, t + dt)."""

    default_sharing: ClassVar[Sharing] = "per_frame"
    rotation_rate: ClassVar[float] = 1e-3
    """First learning rate of rotations, radians."""
    translation_rate: ClassVar[float] = 1e-2
    """Likewise of translations, baselines: as many pixels as a rotation moves."""

    def names(self, rig: Rig) -> tuple[str, ...]:
        axes = ("x", "y", "z")
        return (*(f"rotation about {a}" for a in axes), *(f"translation {a}" for a in axes))

    def retract(self, value: RigidTransform, step: Floats) -> RigidTransform:
        return RigidTransform(rotation_from_vector(step[:3]) @ value.R, value.t + step[3:])

    def difference(self, value: RigidTransform, other: RigidTransform) -> Floats:
        turned = Rotation.from_matrix(other.R @ value.R.T).as_rotvec()
        return np.concatenate([turned, other.t - value.t])

    def mean(self, values: Sequence[RigidTransform]) -> RigidTransform:
        R = Rotation.from_matrix([pose.R for pose in values]).mean().as_matrix()
        return RigidTransform(R, np.mean([pose.t for pose in values], axis=0))

    def rates(self, value: Value) -> Floats:
        return np.repeat([self.rotation_rate, self.translation_rate], 3)


BLOCKS: dict[str, Block] = {}


def register_block(cls: type[Block]) -> type[Block]:
    """Class decorator that makes a kind of unknown available under its ``name``."""
    BLOCKS[cls.name] = cls()
    ordered = sorted(BLOCKS.items(), key=lambda item: item[1].order)
    BLOCKS.clear()
    BLOCKS.update(ordered)
    register_sharing(cls.name)
    return cls
