"""Frames kept to find a lost one again: by overlap and motion, not by number."""

from dataclasses import dataclass

import numpy as np

from ..geometry.transforms import RigidTransform, rotation_angle
from ..initialisation.pairs import register_pair
from ..initialisation.range_image import RangeImage, RangePyramid, typical_range
from .linearise import Poses

FARTHEST = 0.15
"""Distance between keyframes, parts of the typical range."""
WIDEST = np.radians(12)
"""Angle between keyframes."""
LEAST_OVERLAP = 0.7
"""Share of a frame that the map knew: with less, the frame is a keyframe."""
TRIES = 2
"""Keyframes that a lost frame is compared with: the nearest ones in place, then in turn others."""


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A frame's range image with its pose."""

    number: int
    poses: Poses
    pyramid: RangePyramid


class Keyframes:
    """Of one part; the first is the frame with which the part's map began."""

    def __init__(self) -> None:
        self.kept: list[Keyframe] = []

    def wanted(self, poses: Poses, overlap: float) -> bool:
        """Tell whether a placed frame is to be kept."""
        if not self.kept or overlap < LEAST_OVERLAP:
            return True
        last = self.kept[-1]
        moved = last.poses.world_from_camera.inverse() @ poses.world_from_camera
        far = np.linalg.norm(moved.t) > FARTHEST * last.pyramid.unit
        return bool(far or rotation_angle(moved.R) > WIDEST)

    def add(self, number: int, poses: Poses, image: RangeImage) -> None:
        """Keep a frame."""
        unit = self.kept[0].pyramid.unit if self.kept else typical_range(image)
        self.kept.append(Keyframe(number, poses, RangePyramid(image, unit)))

    def find(
        self, image: RangeImage, near: RigidTransform, turn: int, rng: np.random.Generator
    ) -> list[RigidTransform]:
        """Return poses, world_from_camera, at which a frame may be.

        Args:
            image: of the frame, in the map's unit.
            near: where it was lost.
            turn: how often it was looked for in vain: other keyframes come by and by.
            rng: source of the random starts.
        """
        chosen = self._candidates(near, turn)
        poses = []
        for keyframe in chosen:
            source = RangePyramid(image, keyframe.pyramid.unit)
            if not (source.usable and keyframe.pyramid.usable):
                continue
            pair = register_pair(keyframe.pyramid, source, rng)
            if not pair.fit.fault:
                move = pair.target_from_source
                there = RigidTransform(move.R[0], keyframe.pyramid.unit * move.t[0])
                poses.append(keyframe.poses.world_from_camera @ there)
        return poses

    def _candidates(self, near: RigidTransform, turn: int) -> list[Keyframe]:
        def distance(keyframe: Keyframe) -> float:
            return float(np.linalg.norm(keyframe.poses.world_from_camera.t - near.t))

        ordered = sorted(self.kept, key=distance)
        nearest, others = ordered[:1], ordered[1:]
        shift = (TRIES - 1) * turn
        return nearest + [others[(shift + k) % len(others)] for k in range(TRIES - 1) if others]
