"""Where the unit of length comes from.

The optimisation works in units of the first baseline; a similarity afterwards gives millimetres.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...records.rig import Rig


@dataclass(frozen=True)
class Unit:
    """Length of the first baseline in the solution's unit."""

    factor: float
    kind: Literal["baseline", "known_distance", "up_to_scale"]
    std_relative: float
    """Standard deviation of the factor over the factor."""
    warning: str = ""
    """Why the unit that was asked for could not be had."""

    @property
    def name(self) -> Literal["mm", "baseline"]:
        return "baseline" if self.kind == "up_to_scale" else "mm"

    def pose(self, pose: RigidTransform) -> RigidTransform:
        """Return a pose with its translation in the solution's unit."""
        return RigidTransform(pose.R, pose.t * self.factor)


def resolve_unit(
    rig: Rig, camera: CameraModel, ranges: Sequence[NDArray[np.float64] | None]
) -> Unit:
    """Return the unit that the rig asks for, or up to scale if the frame it names was left out.

    Args:
        rig: whose ``scale`` decides.
        camera: the camera of the ranges.
        ranges: for every frame given (H, W) along the unit camera rays, baselines of the first
            frame used, NaN = not seen; None for a frame that was left out.

    Raises:
        InputError: the known distance lies where nothing was measured.
    """
    scale = rig.scale
    if scale.baseline is not None:
        if ranges[0] is None and rig.share.projector_pose == "per_frame":
            return _up_to_scale("scale.baseline is that of the first frame, which was left out")
        return Unit(scale.baseline, "baseline", scale.baseline_std / scale.baseline)
    distance = scale.known_distance
    if distance is None:
        return Unit(1.0, "up_to_scale", 0.0)
    image = ranges[distance.frame]
    if image is None:
        return _up_to_scale("the frame of scale.known_distance was left out")
    pixels = np.array(distance.pixels)
    at = np.array([_bilinear(image, p) for p in pixels])
    if not np.isfinite(at).all():
        raise InputError(
            f"no surface was measured at {distance.pixels}", "scale.known_distance.pixels",
            "choose points inside the measured part of the image",
        )  # fmt: skip
    ends = camera.rays(pixels) * at[:, None]
    return Unit(
        float(distance.mm / np.linalg.norm(ends[0] - ends[1])),
        "known_distance",
        distance.std / distance.mm,
    )


def _up_to_scale(why: str) -> Unit:
    lengths = "lengths are multiples of the first baseline used"
    return Unit(1.0, "up_to_scale", 0.0, f"{why}: {lengths}")


def _bilinear(image: NDArray[np.float64], pixel: NDArray[np.float64]) -> float:
    """Interpolate an (H, W) image at (x, y); NaN outside and beside missing pixels."""
    height, width = image.shape
    x, y = np.clip(pixel, 0, [width - 1, height - 1])
    x0, y0 = int(min(x, width - 2)), int(min(y, height - 2))
    fx, fy = x - x0, y - y0
    patch = image[y0 : y0 + 2, x0 : x0 + 2]
    weights = np.outer([1 - fy, fy], [1 - fx, fx])
    used = weights > 0
    return float((patch[used] * weights[used]).sum())
