from dataclasses import dataclass
from mitsuba_endo.geometry.transforms import RigidTransform
from .range_image import RangeImage
@dataclass(frozen=True, eq=False)
class Registration:
    world_from_camera: RigidTransform
    scale: float
    residual: float
    overlap: float
    reliable: bool
    reason: str
