"""Frames that show the same: they average noise and bring no other view of the unknowns."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...initialisation.outlier_rejection import median_filter
from ...records.correspondence import CorrespondenceMap
from .estimates import listed

_SMALL_SHARE = 0.02
"""Change below which two frames are alike: of the image, relative to its width, and of the
projector coordinates, relative to what a map spans."""
_NOISE = 3.0
"""A change within this many standard deviations of the noise cannot be told from it."""
_CHANGED_SHARE = 0.02
"""Share of the common pixels up to which frames count as alike: an object of a seventh of the
image's width and height changes more when it moves."""
_COMMON_SHARE = 0.5
"""Share of the smaller map that both must hold to be compared."""


@dataclass(frozen=True, eq=False)
class FrameView:
    """One frame of a solution."""

    map: CorrespondenceMap
    points: NDArray[np.float64]
    """(H, W, 3) in its camera's frame, NaN = not seen."""
    world_from_camera: RigidTransform
    surface: int
    """Index of the surface that it sees."""


def alike(a: FrameView, b: FrameView, camera: CameraModel, noise_px: float) -> bool:
    """Tell whether two frames show the same view.

    Of one surface they do if neither camera nor projector has moved by much; of two surfaces, if
    their maps differ by no more than noise.

    Args:
        a: one frame.
        b: another one, of the same camera.
        camera: of both.
        noise_px: standard deviation of one coordinate, pattern pixels.
    """
    both = a.map.valid & b.map.valid
    if both.sum() < _COMMON_SHARE * min(a.map.valid.sum(), b.map.valid.sum()) or not both.any():
        return False
    if a.surface != b.surface:
        return changed_share(a.map, b.map, _NOISE * noise_px) < _CHANGED_SHARE
    span = float(np.ptp(np.percentile(a.map.q[both], [10, 90], axis=0), axis=0).max())
    limit = max(_SMALL_SHARE * span, _NOISE * noise_px)
    still = image_motion(a, b, camera) < _SMALL_SHARE * camera.width
    return still and changed_share(a.map, b.map, limit) < _CHANGED_SHARE


def changed_share(a: CorrespondenceMap, b: CorrespondenceMap, limit: float) -> float:
    """Return the share of common pixels around which coordinates differ by more than ``limit``.

    A small object that moves before a still wall changes few pixels, but all of a neighbourhood;
    gross errors of a decoder change single ones, which a median over 5 x 5 pixels leaves out.
    """
    both = a.valid & b.valid
    change = np.linalg.norm(np.where(both[..., None], a.q - b.q, 0.0), axis=-1)
    around = median_filter(change[..., None], both)[..., 0]
    return float((around[both] > limit).mean())


def image_motion(a: FrameView, b: FrameView, camera: CameraModel) -> float:
    """Return by how many pixels (median) the points that ``a`` sees have moved in ``b``."""
    finite = np.isfinite(a.points[..., 0])
    if not finite.any():
        return np.inf
    b_from_a = b.world_from_camera.inverse() @ a.world_from_camera
    moved = camera.project(b_from_a.apply(a.points[finite])) - camera.pixel_grid()[finite]
    distance = np.linalg.norm(moved, axis=-1)
    return float(np.median(np.where(np.isfinite(distance), distance, np.inf)))


def redundancy_warnings(
    views: Sequence[FrameView], camera: CameraModel, noise_px: float
) -> list[str]:
    """Return a sentence for every frame that repeats an earlier one."""
    out: dict[str, str] = {}
    for first, second in combinations(views, 2):
        names = first.map.name, second.map.name
        if not out.keys() & names and alike(first, second, camera, noise_px):
            out[names[1]] = (
                f"frames {names[0]} and {names[1]} are nearly identical: together they hold no "
                "more information than one, apart from averaged noise; move between captures"
            )
    if len(out) > 1:
        return [
            f"{len(out)} frames are nearly identical to earlier ones ({listed(list(out))}): "
            "together such frames hold no more information than one, apart from averaged noise; "
            "move between captures"
        ]
    return list(out.values())
