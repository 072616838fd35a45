"""Parts of a sequence that meet again: where one saw what another saw, they become one.

Keyframes of a later part are tried where those of an earlier one were, and registered with them
without a guess. A keyframe is placed on the earlier part's map as any frame is, which also gives
the ratio of the two units of length; a second frame must fit the map where the first says.
"""

from collections.abc import Sequence
from copy import copy, deepcopy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..fusion import Volume
from ..geometry.transforms import RigidTransform, rotation_angle
from ..initialisation.pairs import register_pair
from ..initialisation.range_image import RangeImage, RangePyramid
from ..records.correspondence import CorrespondenceMap
from ..records.trajectory import FrameRow
from .gate import fault
from .kept_views import KeptView, KeptViews
from .keyframes import Keyframe, Keyframes
from .linearise import Poses, orthonormal
from .part import Part, Setup
from .placement import Placement, Prior, place
from .range_images import ranged
from .run import Recorded

TRIED = 6
"""Keyframes of either part that are compared, spread evenly: 36 pairs, some ten seconds."""
NEAR_SHIFT = 0.03
"""Parts of the typical range, by which the second frame may be off where the first one says."""
NEAR_TURN = np.radians(2)
"""Likewise."""


@dataclass(frozen=True, eq=False)
class Move:
    """From one part's world to another's."""

    scale: float
    rigid: RigidTransform

    def of(self, poses: Poses) -> Poses:
        """Return poses in the other world and its unit of length."""
        camera, projector = poses.world_from_camera, poses.projector_from_camera
        there = self.rigid @ RigidTransform(camera.R, self.scale * camera.t)
        return Poses(orthonormal(there), RigidTransform(projector.R, self.scale * projector.t))


@dataclass(eq=False)
class Joined:
    """One part, or several that met."""

    setup: Setup
    views: KeptViews
    volume: Volume
    keyframes: Keyframes
    maps: list[tuple[int, CorrespondenceMap]]
    """Of some keyframes, with their numbers."""


def join(recorded: Recorded) -> tuple[list[Joined], list[FrameRow]]:
    """Return the parts that are left when those that meet are one, and the frames in their worlds.

    The world of what is joined is that of its earliest part.
    """
    wholes: list[Joined] = []
    rows = recorded.rows
    for number, part in enumerate(recorded.parts):
        maps = list(recorded.kept[number].kept)
        meeting = _meeting(part, wholes)
        if meeting is None:
            wholes.append(Joined(part.setup, part.views, part.volume, part.keyframes, maps))
            into, move = len(wholes) - 1, None
        else:
            into, move = meeting
            _add(wholes[into], part, move)
            wholes[into].maps += maps
        rows = [_row(row, number, into, move) for row in rows]
    return wholes, [replace(row, part=-1 - row.part) if row.part < 0 else row for row in rows]


def _row(row: FrameRow, part: int, into: int, move: Move | None) -> FrameRow:
    """Return a row in its new part; numbers below zero are done."""
    if row.part != part:
        return row
    row = replace(row, part=-1 - into)
    camera, projector = row.world_from_camera, row.projector_from_camera
    if move is None or camera is None or projector is None:
        return row
    poses = move.of(Poses(camera, projector))
    return replace(
        row, world_from_camera=poses.world_from_camera,
        projector_from_camera=poses.projector_from_camera,
    )  # fmt: skip


def _meeting(part: Part, wholes: Sequence[Joined]) -> tuple[int, Move] | None:
    rng = np.random.default_rng(part.setup.seed)
    for number, whole in enumerate(wholes):
        move = _onto(part, whole, rng)
        if move is not None:
            return number, move
    return None


def _onto(part: Part, whole: Joined, rng: np.random.Generator) -> Move | None:
    """Return how a part lies in another's world, if two of its frames agree about it."""
    for start in (_same_place, _registered):
        for keyframe in _spread(part.keyframes.kept):
            for other in _spread(whole.keyframes.kept):
                camera = start(keyframe, other, rng)
                move = None if camera is None else _placed(part, whole, keyframe, camera)
                if move is not None and _confirmed(part, whole, keyframe.number, move):
                    return move
    return None


def _same_place(
    _keyframe: Keyframe, other: Keyframe, _rng: np.random.Generator
) -> RigidTransform | None:
    """Begin where the other keyframe was: a camera often comes back the way it went."""
    return other.poses.world_from_camera


def _registered(
    keyframe: Keyframe, other: Keyframe, rng: np.random.Generator
) -> RigidTransform | None:
    """Return where two range images put the first camera, or None where they do not fit."""
    source = RangePyramid(keyframe.pyramid.image, other.pyramid.unit)
    if not (source.usable and other.pyramid.usable):
        return None
    pair = register_pair(other.pyramid, source, rng)
    if pair.fit.fault:
        return None
    target_from_source = pair.target_from_source
    there = RigidTransform(target_from_source.R[0], other.pyramid.unit * target_from_source.t[0])
    return other.poses.world_from_camera @ there


def _spread(keyframes: Sequence[Keyframe]) -> list[Keyframe]:
    at = np.linspace(0, len(keyframes) - 1, min(TRIED, len(keyframes)))
    return [keyframes[k] for k in np.unique(at.astype(int))]


def _placed(part: Part, whole: Joined, keyframe: Keyframe, camera: RigidTransform) -> Move | None:
    view = next((v for v in _views(part) if v.number == keyframe.number), None)
    if view is None:
        return None
    start = Poses(orthonormal(camera), keyframe.poses.projector_from_camera)
    placement = _place(view, start, whole)
    if fault(placement):
        return None
    own, there = keyframe.poses, placement.poses
    scale = np.linalg.norm(there.projector_from_camera.t) / np.linalg.norm(
        own.projector_from_camera.t
    )
    own_camera = RigidTransform(own.world_from_camera.R, scale * own.world_from_camera.t)
    return Move(float(scale), there.world_from_camera @ own_camera.inverse())


def _confirmed(part: Part, whole: Joined, number: int, move: Move) -> bool:
    """Tell whether another frame of the part fits the map where the move says it is."""
    others = [v for v in _views(part) if v.number != number]
    if not others:
        return False
    view = min(others, key=lambda v: abs(v.number - number))
    said = move.of(view.poses)
    placement = _place(view, said, whole)
    off = said.world_from_camera.inverse() @ placement.poses.world_from_camera
    far = np.linalg.norm(off.t) > NEAR_SHIFT * whole.keyframes.kept[0].pyramid.unit
    return not (fault(placement) or far or rotation_angle(off.R) > NEAR_TURN)


def _views(part: Part) -> list[KeptView]:
    return [*part.views.fused, *part.views.between]


def _place(view: KeptView, start: Poses, whole: Joined) -> Placement:
    prior = Prior(start.projector_from_camera, np.zeros((6, 6)))
    sample = view.view.sample(whole.setup.projector)
    return place(sample, start, whole.setup.projector, whole.volume, prior, view.noise)


def _add(whole: Joined, part: Part, move: Move) -> None:
    """Take over what a part saw, in the other's world; the tracked parts stay as they are."""
    whole.views, whole.volume = deepcopy(whole.views), deepcopy(whole.volume)
    whole.keyframes = copy(whole.keyframes)
    for views, fused in ((part.views.fused, True), (part.views.between, False)):
        for view in views:
            moved = replace(view, poses=move.of(view.poses))
            whole.views.take(moved, fused=fused)
            if fused:
                ranges = ranged(moved.view, moved.poses, whole.setup.projector, moved.noise)
                whole.volume.integrate(ranges.frame)
    moved_keyframes = [_keyframe(kept, move) for kept in part.keyframes.kept]
    whole.keyframes.kept = [*whole.keyframes.kept, *moved_keyframes]


def _keyframe(kept: Keyframe, move: Move) -> Keyframe:
    image = kept.pyramid.image
    scaled: NDArray[np.float64] = move.scale * image.range
    pyramid = RangePyramid(RangeImage(image.rays, scaled, image.camera), kept.pyramid.unit)
    return Keyframe(kept.number, move.of(kept.poses), pyramid)
