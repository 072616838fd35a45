"""What the camera of each frame sees of the surface that was found."""

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..evaluate.depth import RayCaster
from ..geometry.transforms import RigidTransform
from ..records.calibration import Calibration, SurfaceEstimate
from .frame_poses import frame_poses

Floats = NDArray[np.float64]


class FrameViews:
    """Surface points as the frames of a calibration see them; each mesh enters Mitsuba once."""

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._seen = [at.first_from_camera for at in frame_poses(calibration.solution)]
        self._casters: dict[int, RayCaster] = {}

    def surface_of(self, frame: int) -> SurfaceEstimate:
        """Return the surface that a frame sees; its own is in its camera's frame."""
        return self._calibration.own_surfaces.get(frame, self._calibration.surface)

    def surface_from_camera(self, frame: int) -> RigidTransform:
        """Return where a frame's camera is in the frame of the surface that it sees.

        Raises:
            InputError: the camera's pose could not be determined.
        """
        pose = self._seen[frame]
        if frame == 0 or frame in self._calibration.own_surfaces:
            return RigidTransform.identity()
        if pose is None:
            at = self._calibration.solution.frames[frame]
            raise InputError(
                f"the camera pose of {at.name} could not be determined", "frame",
                at.world_from_camera.reason or "choose another frame",
            )  # fmt: skip
        return pose

    def points(self, frame: int) -> Floats:
        """Return the points (H, W, 3) that a frame's pixels see, in its camera's frame; NaN = none.

        Raises:
            InputError: the camera's pose could not be determined.
        """
        pose, rays = self.surface_from_camera(frame), self._calibration.camera.grid_rays
        along = pose.rotate(rays.reshape(-1, 3))
        ranges = self._caster(frame).range(pose.t, along).reshape(rays.shape[:2])
        return ranges[..., None] * rays

    def _caster(self, frame: int) -> RayCaster:
        own = frame if frame in self._calibration.own_surfaces else 0
        if own not in self._casters:
            surface = self.surface_of(own)
            self._casters[own] = RayCaster(surface.vertices, surface.faces)
        return self._casters[own]
