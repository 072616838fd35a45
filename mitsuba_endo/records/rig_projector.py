"""The projector in a rig file: what is known of it, what is to be found, and where to begin."""

import contextlib
from typing import Annotated, Any

import numpy as np
from pydantic import Field, field_validator, model_validator

from ..geometry.projection_models import PROJECTION_MODELS, ProjectorModel, projector_model
from ..geometry.transforms import RigidTransform
from .validation import Length, Matrix3, Real, Record, Size, Vector2, Vector3

AUTO_LAW = "auto"
MAX_PROJECTOR_DISTORTION = 5
"""Coefficients of Brown's model: k1, k2, p1, p2, k3."""


class Focal(Record):
    """Focal length of the projector, pattern pixels; written as a number it is known and fixed."""

    value: Length | None = None
    """Known value or starting guess; not needed when it is to be found."""
    refine: bool = True
    """Whether it is an unknown."""

    @model_validator(mode="after")
    def _known_if_fixed(self) -> "Focal":
        if self.value is None and not self.refine:
            raise ValueError("refine is false but value is missing; give value or refine: true")
        return self


class GivenPose(Record):
    """Rigid transform X_projector = R X_camera + t; R is 3x3 or a rotation vector (radians)."""

    R: Matrix3 | Vector3
    t: Vector3

    @field_validator("R", mode="before")
    @classmethod
    def _shape(cls, value: Any) -> Any:
        try:
            R = np.asarray(value, float)
        except (TypeError, ValueError):
            R = np.empty(0)
        if R.shape not in ((3, 3), (3,)) or not np.isfinite(R).all():
            raise ValueError("is neither 3x3 nor three finite numbers; give a matrix or a vector")
        return value

    @field_validator("R")
    @classmethod
    def _rotation(cls, value: Any) -> Any:
        R = np.asarray(value, float)
        if R.shape == (3, 3) and not (
            np.allclose(R @ R.T, np.eye(3), atol=1e-4) and np.linalg.det(R) > 0
        ):
            raise ValueError("is not a rotation matrix; its rows must be orthonormal, det = +1")
        return value

    def to_transform(self) -> RigidTransform:
        return RigidTransform.of(self.R, self.t)


class Projector(Record):
    """Intrinsics of the projector and what is to be found of it."""

    law: str = "direction_cosine"
    """``pinhole``, ``direction_cosine``, or ``auto`` to fit both and compare."""
    width: Size
    """Pattern pixels."""
    height: Size
    """Pattern pixels."""
    focal: Focal = Focal()
    centre: Vector2 | None = None
    """Principal point, pattern pixels; default: the middle of the pattern."""
    centre_std: Annotated[list[Length], Field(min_length=2, max_length=2)] | None = None
    """Standard deviations of ``centre``, pattern pixels: a prior where it is an unknown."""
    aspect: Annotated[float, Field(ge=0.01, le=100)] = 1.0
    """fy / fx."""
    distortion: Annotated[list[Real], Field(max_length=MAX_PROJECTOR_DISTORTION)] = []
    """k1, k2, p1, p2, k3 on the law's normalised coordinates, shorter lists allowed."""
    grid_period: Length | None = None
    """Period of the pattern's grid, pattern pixels: lets slips of the decoder by whole periods be
    told from other errors."""
    pose: GivenPose | None = None
    """Start for projector_from_camera, mm."""

    @field_validator("law")
    @classmethod
    def _known_law(cls, value: str) -> str:
        if value != AUTO_LAW and value not in PROJECTION_MODELS:
            names = ", ".join([*PROJECTION_MODELS, AUTO_LAW])
            raise ValueError(f"unknown projection model '{value}'; choose from {names}")
        return value

    @field_validator("focal", mode="before")
    @classmethod
    def _number_is_fixed(cls, value: Any) -> Any:
        if isinstance(value, str):  # YAML 1.1 reads 1e3, without a point, as text
            with contextlib.suppress(ValueError):
                value = float(value)
        if isinstance(value, int | float) and not isinstance(value, bool):
            return {"value": value, "refine": False}
        return value

    @property
    def middle(self) -> list[float]:
        """Middle of the pattern under the pixel-centre convention."""
        return [(self.width - 1) / 2, (self.height - 1) / 2]

    def to_model(self, law: str | None = None) -> ProjectorModel:
        """Build the model; an unknown focal length becomes the pattern's width."""
        return projector_model(
            law or self.law, self.focal.value or float(self.width), self.centre or self.middle,
            self.aspect, self.distortion,
        )  # fmt: skip
