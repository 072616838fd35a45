"""The camera in a rig file: intrinsics from any calibration, and how well they are known."""

from typing import Annotated

import numpy as np
from pydantic import Field, field_validator, model_validator

from ..geometry.cameras import CAMERAS, CameraModel
from .validation import Length, Matrix3, Real, Record, Size

LEAST_FOCAL = 1e-3
"""Pixels; with less, the whole of space lies within one."""
LEAST_TERMS = 2
"""Coefficients that can be unknowns where fewer are given: k1 and k2, or a model's first two."""


class Camera(Record):
    """Intrinsics of the camera, known beforehand."""

    model: str = "opencv"
    """``opencv`` (pinhole + Brown), ``opencv_fisheye``, ``omni``, ``double_sphere`` or
    ``scaramuzza``; ``kannala_brandt`` is another name of ``opencv_fisheye``."""
    width: Size
    """Pixels."""
    height: Size
    """Pixels."""
    K: Matrix3
    """Camera matrix, pixels, integer pixel = pixel centre."""
    distortion: list[Real] = []
    """Coefficients in the model's order: k1, k2, p1, p2, k3[, k4, k5, k6]; fisheye k1..k4; omni
    xi, k1, k2, p1, p2, k3; double_sphere xi, alpha; scaramuzza b1..b4, d, e."""
    K_std: Annotated[list[Length], Field(min_length=4, max_length=4)] | None = None
    """Standard deviations of fx, fy, cx, cy, pixels: a prior where they are unknowns."""
    distortion_std: Length | list[Length] | None = None
    """Standard deviation of every coefficient, or one for all, likewise."""

    @field_validator("model")
    @classmethod
    def _known_model(cls, value: str) -> str:
        value = "opencv_fisheye" if value == "kannala_brandt" else value
        if value not in CAMERAS:
            raise ValueError(f"unknown camera model '{value}'; choose from {', '.join(CAMERAS)}")
        return value

    @field_validator("K")
    @classmethod
    def _camera_matrix(cls, value: list[list[float]]) -> list[list[float]]:
        if not (value[0][0] >= LEAST_FOCAL and value[1][1] >= LEAST_FOCAL):
            raise ValueError(
                "the focal lengths on the diagonal are not positive; give fx and fy in pixels"
            )
        if value[0][1] or value[1][0] or value[2] != [0, 0, 1]:
            raise ValueError("is not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]; remove skew and scale")
        return value

    @model_validator(mode="after")
    def _coefficient_count(self) -> "Camera":
        allowed = CAMERAS[self.model].max_coefficients
        if len(self.distortion) not in allowed:
            raise ValueError(
                f"{len(self.distortion)} distortion coefficients do not fit model {self.model}; "
                f"give one of {', '.join(map(str, allowed))}"
            )
        return self

    @model_validator(mode="after")
    def _deviation_count(self) -> "Camera":
        names = CAMERAS[self.model].coefficients[: self.unknown_coefficients]
        std = self.distortion_std
        if isinstance(std, list) and len(std) != len(names):
            raise ValueError(
                f"distortion_std has {len(std)} values and the coefficients that can be unknowns "
                f"are {', '.join(names)}; give one for each, or one number for all"
            )
        return self

    @property
    def unknown_coefficients(self) -> int:
        """Number of coefficients that are unknowns where the sharing plan makes them some."""
        least = min(LEAST_TERMS, max(CAMERAS[self.model].max_coefficients))
        return max(len(self.distortion), least)

    def to_model(self) -> CameraModel:
        return CameraModel(
            self.model, self.width, self.height, np.array(self.K, float), tuple(self.distortion)
        )

    @classmethod
    def from_model(cls, camera: CameraModel) -> "Camera":
        return cls(
            model=camera.model, width=camera.width, height=camera.height,
            K=np.asarray(camera.K).tolist(), distortion=[float(c) for c in camera.distortion],
        )  # fmt: skip
