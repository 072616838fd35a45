"""The first frames: calibrated without any guess, then held to one focal length."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..records.calibration import Calibration
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Camera, Rig
from ..records.solution import Solution
from ..solve.calibrate import calibrate
from ..solve.options import Options
from .epipolar_focal import FocalSum, focal_of
from .linearise import triangulate
from .options import SequenceOptions
from .part import Setup
from .placement import noise_of
from .projector_prior import ProjectorDrift
from .view import ThinnedMap, thinned, thinning

ATTEMPTS = 4
"""Frames, spread over the first ones, of which one must calibrate."""
PIXELS = 1.5
"""Side of a voxel over the size of a pixel on the surface."""
FINEST = 64
"""Voxels in the median range, at most: finer ones cost memory, and noise fills them."""


@dataclass(frozen=True, eq=False)
class Beginning:
    """What the first frames tell."""

    setup: Setup
    first: int
    """Of the views given: the one whose camera is the world, and at whose projector scale hangs."""
    projector_pose: RigidTransform
    """Of this frame: projector_from_camera, the unit of length of the solution."""
    noise: float
    """Of a coordinate, pattern pixels."""
    solution: Solution
    """Of this frame alone."""
    told: FocalSum
    """What the first frames told of the focal length."""


def check_plan(rig: Rig) -> None:
    """Refuse, before any work, a rig whose plan a sequence cannot follow.

    Raises:
        InputError: names the field.
    """
    share, distance = rig.share, rig.scale.known_distance
    rules = [
        (share.camera_pose == "per_frame", "share.camera_pose", "a sequence's camera moves"),
        (share.surface == "shared", "share.surface", "a sequence has one surface"),
        (share.focal != "per_frame", "share.focal", "a sequence has one focal length"),
        (distance is None or distance.frame == 0, "scale.known_distance.frame",
         "the unit of length comes from the first frame"),
    ]  # fmt: skip
    rules += [
        (mode == "fixed" or block in ("centre", "aspect", "distortion"), f"share.{block}",
         "a sequence holds the camera's intrinsics")
        for block, mode in share.further.items()
    ]  # fmt: skip
    for kept, where, why in rules:
        if not kept:
            raise InputError(f"does not suit a sequence: {why}", where, "change it or calibrate")
    ProjectorDrift.of(rig, 1.0)


def begin(
    maps: Sequence[CorrespondenceMap],
    views: Sequence[ThinnedMap],
    rig: Rig,
    options: SequenceOptions,
) -> Beginning:
    """Calibrate one of the first frames, and take the focal length from all that follow it.

    Args:
        maps: of the first frames that show enough.
        views: of the same frames.
        rig: what is known.
        options: how to go through the sequence.

    Raises:
        InputError: none of the frames tells focal length and pose; says what to do.
    """
    first, calibration = _calibrated(maps, rig)
    projector, pose = _calibration_of(calibration)
    free = rig.projector.focal.refine and rig.share.focal != "fixed"
    agreed = focal_of(views[first:], projector, pose, free=free)
    if rig.share.projector_pose != "per_frame":
        agreed = replace(agreed, poses=[pose])
    view, projector, pose = views[first], agreed.projector, agreed.poses[0]
    triangulated = triangulate(view.sample(projector), projector, pose)
    voxel = options.voxel or _voxel(view, triangulated.range[triangulated.good])
    setup = Setup(
        view.camera, thinning(rig.camera.to_model()), projector,
        ProjectorDrift.of(rig, float(np.linalg.norm(pose.t))), voxel, options.fuse_every,
        options.seed,
    )  # fmt: skip
    return Beginning(
        setup, first, pose, noise_of(triangulated, 1.0), calibration.solution, agreed.told
    )


def _calibrated(maps: Sequence[CorrespondenceMap], rig: Rig) -> tuple[int, Calibration]:
    """Return the first of a few frames that tells focal length and pose, and its calibration."""
    failed: InputError | None = None
    for k in np.unique(np.linspace(0, len(maps) - 1, ATTEMPTS).astype(int)).tolist():
        try:
            calibration = _alone(maps[k], rig)
        except InputError as error:
            failed = failed or error
            continue
        if (
            calibration.solution.projector.to_model()
            and calibration.solution.frames[0].projector_from_camera.R
        ):
            return k, calibration
    if failed is not None:
        raise failed
    raise InputError(
        "none of the first frames tells the projector's focal length and pose", maps[0].name,
        "begin with frames that see a surface with relief, or give projector.focal in the rig",
    )  # fmt: skip


def _alone(map_: CorrespondenceMap, rig: Rig) -> Calibration:
    """Calibrate one frame, thinned."""
    full = rig.camera.to_model()
    step = thinning(full)
    camera = Camera.from_model(thinned(full, step))
    distance = rig.scale.known_distance
    if distance is not None and step > 1:
        pixels = [[c / step for c in pixel] for pixel in distance.pixels]
        distance = distance.model_copy(update={"pixels": pixels})
    scale = rig.scale.model_copy(update={"known_distance": distance})
    own = rig.model_copy(update={"camera": camera, "scale": scale, "drift": None})
    small = CorrespondenceMap(map_.q[::step, ::step], map_.name)
    return calibrate([small], own, Options(jackknife=False, check_model=False))


def _calibration_of(calibration: Calibration) -> tuple[ProjectorModel, RigidTransform]:
    model = calibration.solution.projector.to_model()
    pose = calibration.solution.frames[0].projector_from_camera.to_transform()
    assert model is not None
    assert pose is not None
    return model, pose


def _voxel(view: ThinnedMap, ranges: np.ndarray) -> float:
    """Return the side of the map's voxels, the unit of the ranges."""
    middle = float(np.median(ranges))
    rays = view.camera.grid_rays
    angle = float(np.nanmedian(np.linalg.norm(np.diff(rays, axis=1), axis=-1)))
    return max(PIXELS * angle * middle, middle / FINEST)
