"""The rig file: what is known of camera and projector, and what is to be found."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from ..reading.trees import read_yaml
from .camera_files.in_rig import camera_values, named_file, projector_values
from .rig_camera import Camera
from .rig_projector import AUTO_LAW, MAX_PROJECTOR_DISTORTION, Focal, GivenPose, Projector
from .sharing import Share, Sharing, register_sharing
from .validation import LARGEST, Length, Record, Vector2, validate

__all__ = [
    "AUTO_LAW",
    "MAX_PROJECTOR_DISTORTION",
    "Camera",
    "Drift",
    "Focal",
    "GivenPose",
    "KnownDistance",
    "Projector",
    "Rig",
    "Scale",
    "Share",
    "Sharing",
    "load_rig",
    "read_rig",
    "register_sharing",
]


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
