"""What the cameras of a sequence's frames see of the surface that was found."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..evaluate.depth import RayCaster
from ..records.trajectory import FrameRow
from ..sequence.outcome import SequenceResult
from .extras import check_extras, write_depth, write_points

Floats = NDArray[np.float64]

KINDS: dict[str, tuple[str, Callable[[Path, Floats], None]]] = {
    "depth": (".exr", write_depth),
    "points": (".ply", write_points),
}
"""By the name that ``sequence --save`` takes: suffix, and what writes a file of a frame's points
(H, W, 3)."""


class SequenceViews:
    """Points that frames see; each part's mesh enters Mitsuba once."""

    def __init__(self, result: SequenceResult) -> None:
        self._result = result
        self._camera = result.rig.camera.to_model()
        self._casters: dict[int, RayCaster] = {}

    def points(self, row: FrameRow) -> Floats:
        """Return the points (H, W, 3) that a frame's pixels see, in its camera's frame; NaN = none.

        Raises:
            InputError: the frame was lost, or its part has no surface.
        """
        pose = row.world_from_camera
        if pose is None:
            raise InputError(f"frame {row.name} was lost: {row.lost}", "frame", "choose another")
        rays = self._camera.grid_rays
        along = pose.rotate(rays.reshape(-1, 3))
        ranges = self._caster(row).range(pose.t, along).reshape(rays.shape[:2])
        return ranges[..., None] * rays

    def _caster(self, row: FrameRow) -> RayCaster:
        if row.part not in self._casters:
            surface = self._result.surfaces[row.part]
            if surface is None:
                raise InputError(f"no surface was found around {row.name}", "frame", "another one")
            self._casters[row.part] = RayCaster(surface.vertices, surface.faces)
        return self._casters[row.part]


def save_views(folder: Path, result: SequenceResult, kinds: Sequence[str]) -> None:
    """Write files of every placed frame of parts with a surface into folders of their kind's name.

    Raises:
        InputError: an unknown kind, or a file cannot be written.
    """
    check_extras(kinds, "kinds", KINDS)
    if not kinds:
        return
    views = SequenceViews(result)
    for kind in kinds:
        (folder / kind).mkdir()
    for row in result.rows:
        if row.lost or result.surfaces[row.part] is None:
            continue
        points = views.points(row)
        for kind in kinds:
            suffix, write = KINDS[kind]
            name = re.sub(r"[^\w.-]+", "_", Path(row.name).stem)
            write(folder / kind / f"{row.number:05d}_{name}{suffix}", points)
