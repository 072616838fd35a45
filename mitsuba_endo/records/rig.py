"""The rig file: what is known of camera and projector, and what is to be found."""

import contextlib
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from ..geometry.cameras import CAMERAS, CameraModel
from ..geometry.laws import LAWS, ProjectorModel, projector_model
from ..geometry.transforms import RigidTransform
from ..reading.trees import read_yaml
from .camera_files.in_rig import camera_values, named_file, projector_values
from .validation import LARGEST, Length, Real, Record, Size, validate

Matrix3 = Annotated[
    list[Annotated[list[Real], Field(min_length=3, max_length=3)]],
    Field(min_length=3, max_length=3),
]
Vector3 = Annotated[list[Real], Field(min_length=3, max_length=3)]
Vector2 = Annotated[list[Real], Field(min_length=2, max_length=2)]
Sharing = Literal["fixed", "shared", "per_frame"]
AUTO_LAW = "auto"
MAX_PROJECTOR_DISTORTION = 5
LEAST_FOCAL = 1e-3
"""Pixels; with less, the whole of space lies within one."""


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
        given, std = len(self.distortion), self.distortion_std
        if isinstance(std, list) and len(std) != max(given, 1):
            raise ValueError(
                f"distortion_std has {len(std)} values and distortion {given}; give one for each "
                "coefficient, or one number for all"
            )
        return self

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
        if value != AUTO_LAW and value not in LAWS:
            names = ", ".join([*LAWS, AUTO_LAW])
            raise ValueError(f"unknown projector law '{value}'; choose from {names}")
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


class KnownDistance(Record):
    """Distance between two points of the surface seen in one frame."""

    pixels: Annotated[list[Vector2], Field(min_length=2, max_length=2)]
    """The two points, camera pixels."""
    mm: Length
    std: float = Field(default=0.0, ge=0, le=LARGEST)
    """Standard deviation of ``mm``."""
    frame: int = Field(default=0, ge=0)
    """Index of the frame."""


class Scale(Record):
    """Where the unit of length comes from: correspondences alone never fix it."""

    baseline: Length | None = None
    """|t| of the first frame's projector_from_camera, mm."""
    baseline_std: float = Field(default=0.0, ge=0, le=LARGEST)
    """Standard deviation of ``baseline``, mm."""
    known_distance: KnownDistance | None = None

    @model_validator(mode="after")
    def _one_source(self) -> "Scale":
        if self.baseline is not None and self.known_distance is not None:
            raise ValueError("baseline and known_distance are both given; keep one")
        if self.baseline is None and self.baseline_std:
            raise ValueError("baseline_std is given without baseline; add baseline")
        return self

    @property
    def kind(self) -> Literal["baseline", "known_distance", "up_to_scale"]:
        if self.baseline is not None:
            return "baseline"
        return "known_distance" if self.known_distance else "up_to_scale"


_FURTHER_BLOCKS: set[str] = set()


def register_sharing(block: str) -> None:
    """Let the sharing plan of rig files name a block of unknowns that is no field of it."""
    if block not in Share.model_fields:
        _FURTHER_BLOCKS.add(block)


class Share(Record):
    """Sharing plan: for each block of unknowns ``fixed``, ``shared`` or ``per_frame``."""

    surface: Sharing = "shared"
    camera_pose: Sharing = "per_frame"
    projector_pose: Sharing = "per_frame"
    focal: Sharing | None = None
    """Default: ``shared`` if ``projector.focal.refine``, else ``fixed``."""
    centre: Sharing | None = None
    """Default: ``fixed``; ``shared`` where it is not given and found beside the middle."""
    aspect: Sharing = "fixed"
    distortion: Sharing = "fixed"

    further: dict[str, Sharing] = {}
    """Of blocks registered by :func:`register_sharing`, which files name like the others."""

    @model_validator(mode="before")
    @classmethod
    def _registered(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        further = {k: v for k, v in data.items() if k in _FURTHER_BLOCKS}
        rest = {k: v for k, v in data.items() if k not in further}
        return {**rest, "further": {**rest.get("further", {}), **further}} if further else rest

    def of(self, block: str) -> Sharing | None:
        """Return the mode that the plan names for a block, or None."""
        return getattr(self, block, None) or self.further.get(block)


class Drift(Record):
    """Random walk of the projector in its channel from frame to frame (spread per step)."""

    insertion_mm: Length | None = None
    """Standard deviation of the step along the projector's axis, mm."""
    roll_deg: Length | None = None
    """Standard deviation of the step about the projector's axis, degrees."""
    lateral_mm: Length | None = None
    """Standard deviation of the step across the axis, mm."""
    tilt_deg: Length | None = None
    """Standard deviation of the step of the axis' direction, degrees."""


class Rig(Record):
    """Contents of ``rig.yaml``."""

    units: Literal["mm"] = "mm"
    camera: Camera
    projector: Projector
    scale: Scale = Scale()
    share: Share = Share()
    drift: Drift | None = None

    @field_validator("scale", mode="before")
    @classmethod
    def _up_to_scale(cls, value: Any) -> Any:
        if value in ("up_to_scale", {"up_to_scale": True}, {"up_to_scale": None}, None):
            return {}
        return value


def load_rig(path: str | Path) -> Rig:
    """Read and validate ``rig.yaml``; ``camera`` and ``projector`` may name other programs' files.

    Raises:
        InputError: names the file and field.
    """
    return read_rig(path)[0]


def read_rig(path: str | Path) -> tuple[Rig, list[str]]:
    """Read a rig file as :func:`load_rig` does, and say what was read from other files.

    Returns:
        The rig, and one sentence a file: its format, camera model and coefficients.

    Raises:
        InputError: names the file and field.
    """
    path = Path(path)
    data = read_yaml(path)
    notes: list[str] = []
    camera, projector = (named_file(data.get(key)) for key in ("camera", "projector"))
    if camera is not None:
        values, source = camera_values(path, camera, notes, projector is not None)
        data["camera"] = validate(Camera, values, source)
    if projector is not None:
        data["projector"] = projector_values(path, projector, notes)
    return validate(Rig, data, str(path)), notes
