"""What a calibration found, as programs want it: images, points, poses, distances, a folder."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, shown
from ..geometry.transforms import RigidTransform
from ..records.calibration import Calibration, SurfaceEstimate
from ..records.rig import Rig
from ..records.solution import PoseEstimate, Solution
from ..show.frame_views import FrameViews
from ..show.measure import Distance, distance, pick
from ..show.solution_folder import write_solution_folder

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FramePose:
    """Where the devices of one frame are; None what could not be determined."""

    name: str
    world_from_camera: RigidTransform | None
    """The world is the first frame's camera."""
    projector_from_camera: RigidTransform | None
    camera_covariance: Floats | None
    """(6, 6) of a rotation vector, radians, and the translation, in the result's unit; None where
    the pose is not an unknown."""
    projector_covariance: Floats | None
    """Likewise."""


class Result:
    """A calibration, as :func:`mitsuba_endo.calibrate` and :func:`mitsuba_endo.load` give it.

    Frames are counted from 0 or named. Lengths are in :attr:`unit`.
    """

    def __init__(self, calibration: Calibration, rig: Rig | None = None) -> None:
        """Wrap a calibration.

        Args:
            calibration: with its arrays.
            rig: from which it was made; saved beside it.
        """
        self.calibration = calibration
        self.rig = rig

    @property
    def solution(self) -> Solution:
        """All values with their standard deviations, as in ``solution.json``."""
        return self.calibration.solution

    @property
    def unit(self) -> str:
        """``mm``, or ``baseline`` where the scale is not known."""
        return self.solution.units

    @property
    def verdict(self) -> str:
        """What was measured and what was not, in words, a line each."""
        return "\n".join(self.solution.verdict)

    @property
    def warnings(self) -> list[str]:
        """What to look at before relying on the numbers."""
        return self.solution.warnings

    @property
    def names(self) -> list[str]:
        """Names of the frames."""
        return [frame.name for frame in self.solution.frames]

    @property
    def surface(self) -> SurfaceEstimate:
        """The mesh of what the frames saw, in the first camera's frame; see :meth:`surface_of`."""
        return self.calibration.surface

    def surface_of(self, frame: int | str = 0) -> SurfaceEstimate:
        """Return the surface that a frame sees: its own, in its camera's frame, where it has one.

        Raises:
            InputError: there is no such frame.
        """
        return self._views.surface_of(self._index(frame))

    def depth(self, frame: int | str = 0) -> Floats:
        """Return the depth (H, W) of a frame: z in its camera's frame; NaN = no surface there.

        Raises:
            InputError: there is no such frame, or its camera pose could not be determined.
        """
        return self.points(frame)[..., 2]

    def points(self, frame: int | str = 0) -> Floats:
        """Return the surface points (H, W, 3) that the pixels of a frame see; NaN = none.

        They are in the frame of that frame's camera; ``result.poses()[k].world_from_camera.apply``
        takes them into the world.

        Raises:
            InputError: there is no such frame, or its camera pose could not be determined.
        """
        return self._views.points(self._index(frame))

    def distance(self, a: Sequence[float], b: Sequence[float], frame: int | str = 0) -> Distance:
        """Return the distance of the surface points that two pixels (x, y) of a frame see.

        Its ``std`` is the standard deviation; ``words(result.solution)`` says the length with its
        95 % interval and unit.

        Raises:
            InputError: a pixel sees no surface, or as :meth:`points`.
        """
        index = self._index(frame)
        surface = self._views.surface_of(index)
        pose = self._views.surface_from_camera(index)
        ends = []
        for name, pixel in (("a", a), ("b", b)):
            ray = pose.rotate(self.calibration.camera.rays(np.asarray(pixel, float)))
            point = pick(surface, pose.t, ray)
            if point is None:
                raise InputError(
                    f"pixel {shown(tuple(pixel))} of {self.names[index]} sees no surface", name,
                    "choose one where depth() has a value",
                )  # fmt: skip
            ends.append(point)
        return distance(surface, ends[0], ends[1], self.solution.scale_std_percent)

    def poses(self) -> list[FramePose]:
        """Return the poses of all frames with their covariances."""
        return [
            FramePose(
                frame.name,
                frame.world_from_camera.to_transform(),
                frame.projector_from_camera.to_transform(),
                _covariance(frame.world_from_camera),
                _covariance(frame.projector_from_camera),
            )
            for frame in self.solution.frames
        ]

    def save(self, folder: str | Path, extras: Sequence[str] = ()) -> None:
        """Write the solution folder that the command ``calibrate`` writes.

        A result that was loaded has no state from which to go on; it is left out.

        Args:
            folder: to write.
            extras: further files: ``depth``, ``points`` and ``masks`` of every frame,
                ``pictures``.

        Raises:
            InputError: the folder holds other files, or cannot be written.
        """
        write_solution_folder(folder, self.calibration, self.rig, extras=extras)

    def __repr__(self) -> str:
        count = len(self.names)
        return f"<mitsuba_endo.Result: {count} frame{'s'[: count > 1]}, {self.solution.outcome}>"

    def _repr_html_(self) -> str:
        return self.solution._repr_html_()

    @cached_property
    def _views(self) -> FrameViews:
        return FrameViews(self.calibration)

    def _index(self, frame: int | str) -> int:
        names = self.names
        if isinstance(frame, str) and frame in names:
            return names.index(frame)
        if isinstance(frame, int | np.integer) and -len(names) <= frame < len(names):
            return int(frame) % len(names)
        raise InputError(
            f"there is no frame {shown(frame)}", "frame",
            f"give 0 to {len(names) - 1}, or a name such as {names[0]}",
        )  # fmt: skip


def _covariance(pose: PoseEstimate) -> Floats | None:
    return None if pose.covariance is None else np.array(pose.covariance)
