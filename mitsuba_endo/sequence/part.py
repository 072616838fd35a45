"""One connected part of a sequence: a map, and the frames that are tracked against it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..fusion import Volume
from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..initialisation.range_image import RangeImage
from .epipolar_focal import pose_directions
from .error_propagation import camera_by_projector
from .gate import fault
from .kept_views import KeptViews
from .keyframes import Keyframes
from .linearise import Poses, orthonormal
from .map_drift import MapDrift, in_world
from .placement import Placement, Prior, place
from .projector_prior import ProjectorDrift
from .range_images import Ranged, ranged
from .shared_errors import SharedErrors
from .view import PixelSample, ThinnedMap

Floats = NDArray[np.float64]

LEAST_OVERLAP = 0.8
"""Share of a frame that the map knew: with less, the frame is fused at once."""
LONGEST_PREDICTION = 10
"""Frames over which the last motion is thought to go on."""


@dataclass(frozen=True, eq=False)
class Setup:
    """What does not change along a sequence."""

    camera: CameraModel
    """Of the thinned images."""
    step: int
    """Of the thinning."""
    projector: ProjectorModel
    drift: ProjectorDrift
    voxel: float
    fuse_every: int
    seed: int


@dataclass(frozen=True, eq=False)
class Tracked:
    """A frame that was placed."""

    poses: Poses
    covariance: Floats
    """(12, 12) of :meth:`RigidTransform.perturbed`'s steps of projector_from_camera and of
    world_from_camera: what the frame's pixels leave open, and how far the map may have drifted."""
    placement: Placement | None
    """None for the frame with which the map began."""
    keyframe: bool


class Part:
    """The map grows by what :meth:`track` places; its world is the first frame's camera."""

    def __init__(
        self,
        setup: Setup,
        number: int,
        view: ThinnedMap,
        projector_pose: RigidTransform,
        noise: float,
    ) -> None:
        """Begin a map with one frame.

        Args:
            setup: what all frames share.
            number: of the frame.
            view: what it saw.
            projector_pose: projector_from_camera, whose translation gives the unit of length.
            noise: of a coordinate, pattern pixels.
        """
        self.setup, self.noise = setup, noise
        self.volume, self.keyframes = Volume(setup.voxel), Keyframes()
        self._spread = SharedErrors()
        self.fused = 0
        self._rng = np.random.default_rng(setup.seed)
        self._before: tuple[int, Poses] | None = None
        self._last = number, Poses(RigidTransform.identity(), projector_pose)
        self._covariance = np.zeros((6, 6))
        self._drift = MapDrift(
            self._covariance_by_lines(view, Prior(projector_pose, np.zeros((6, 6))))
        )
        self._searches = 0
        ranges = ranged(view, self._last[1], setup.projector, noise)
        self.views = KeptViews(view.camera)
        self._fuse(number, ranges)
        self._keep(number, self._last[1], ranges)
        self.views.keep(number, view, self._last[1], noise, fused=True)
        self.first = Tracked(self._last[1], np.zeros((12, 12)), None, keyframe=True)

    def track(self, number: int, view: ThinnedMap) -> Tracked | str:
        """Place a frame against the map and add to the map what it saw; or say why not."""
        sample = view.sample(self.setup.projector)
        since = number - self._last[0]
        prior = self.setup.drift.prior(self._last[1].projector_from_camera, self._covariance, since)
        reason = ""
        for starts in self._starts(view, number, prior):
            placed = [
                place(sample, start, self.setup.projector, self.volume, prior, self.noise)
                for start in starts
            ]
            sound = [placement for placement in placed if not fault(placement)]
            if sound:
                return self._accepted(
                    number, view, sample, min(sound, key=lambda placement: placement.misfit)
                )
            reason = fault(placed[-1]) if placed else reason
        return reason

    def _starts(self, view: ThinnedMap, number: int, prior: Prior) -> Iterator[list[Poses]]:
        """Yield poses to begin with, likely ones first; of those yielded together the best counts.

        The motion may go on. After a gap nothing says so, and where keyframes place the frame
        counts too.
        """
        last = self._last[1]
        since = number - self._last[0]
        going_on = self._predicted(since)
        if since == 1:
            yield going_on
            yield [last]
        else:
            yield [*going_on, last]
        image, projector_pose = self._alone(view, prior)
        near, turn = last.world_from_camera, self._searches
        self._searches += 1
        yield [
            Poses(orthonormal(pose), projector_pose)
            for pose in self.keyframes.find(image, near, turn, self._rng)
        ]

    def _predicted(self, since: int) -> list[Poses]:
        """Return the pose ``since`` frames on if the last motion goes on, if one is known."""
        if self._before is None or since > LONGEST_PREDICTION:
            return []
        pose = self._last[1].world_from_camera
        motion = self._before[1].world_from_camera.inverse() @ pose
        for _ in range(since):
            pose = pose @ motion
        return [Poses(orthonormal(pose), self._last[1].projector_from_camera)]

    def _alone(self, view: ThinnedMap, prior: Prior) -> tuple[RangeImage, RigidTransform]:
        """Return a frame's range image from its own epipolar lines, and the projector's pose."""
        sample, nowhere = view.sample(self.setup.projector), Volume(self.setup.voxel)
        start = Poses(RigidTransform.identity(), prior.mean)
        placement = place(sample, start, self.setup.projector, nowhere, prior, self.noise)
        ranges = ranged(view, placement.poses, self.setup.projector, placement.noise)
        return _image(ranges), placement.poses.projector_from_camera

    def _accepted(
        self, number: int, view: ThinnedMap, sample: PixelSample, placement: Placement
    ) -> Tracked:
        """Take over a placement: next frames begin there, and the map may grow."""
        setup, poses = self.setup, placement.poses
        own = in_world(self._spread.widened(placement), poses.world_from_camera)
        keyframe = self.keyframes.wanted(poses, placement.overlap)
        due = number - self._fused_at >= setup.fuse_every or placement.overlap < LEAST_OVERLAP
        if keyframe or due:
            ranges = ranged(view, poses, setup.projector, placement.noise)
            if keyframe:
                self._keep(number, poses, ranges)
            self._drift.fused(
                poses.world_from_camera, own, self._bent(sample, placement),
                self.keyframes.kept[0].pyramid.unit,
            )  # fmt: skip
            self._fuse(number, ranges)
        self.views.keep(number, view, poses, placement.noise, fused=keyframe or due)
        consecutive = number == self._last[0] + 1
        self._before = self._last if consecutive else None
        self._last, self.noise, self._searches = (number, poses), placement.noise, 0
        self._covariance = own[:6, :6]
        return Tracked(poses, own + self._drift.at(poses.world_from_camera), placement, keyframe)

    def _covariance_by_lines(self, view: ThinnedMap, prior: Prior) -> Floats:
        """Return the covariance (6, 6) of a projector pose that lines alone tell.

        The length of its translation is given.
        """
        sample, nowhere = view.sample(self.setup.projector), Volume(self.setup.voxel)
        start = Poses(RigidTransform.identity(), prior.mean)
        placement = place(sample, start, self.setup.projector, nowhere, prior, self.noise)
        information = np.linalg.inv(placement.covariance[:6, :6])
        scatter = information @ placement.clustered[:6, :6] @ information
        told = pose_directions(prior.mean)
        inverse = np.linalg.inv(told.T @ information @ told)
        return told @ inverse @ (told.T @ scatter @ told) @ inverse @ told.T

    def _bent(self, sample: PixelSample, placement: Placement) -> Floats:
        """Return what a wrong pose of the projector has done since the last fused frame."""
        setup, poses = self.setup, placement.poses
        return camera_by_projector(
            sample, placement.triangulated, poses, self._fused_pose, setup.projector, self.volume
        )

    def _fuse(self, number: int, ranges: Ranged) -> None:
        self.volume.integrate(ranges.frame)
        self._fused_at, self._fused_pose = number, ranges.frame.world_from_camera
        self.fused += 1

    def _keep(self, number: int, poses: Poses, ranges: Ranged) -> None:
        self.keyframes.add(number, poses, _image(ranges))


def _image(ranges: Ranged) -> RangeImage:
    camera = ranges.frame.camera
    return RangeImage(camera.grid_rays, ranges.frame.range, camera)
