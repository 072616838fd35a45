"""What is compared: functions from a folder of inputs to a surface and a focal length."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.records.calibration import Calibration, SurfaceEstimate
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Rig, Share
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

from .capture import read_inputs
from .fusion import Fusion, fuse

LEAN = Options(jackknife=False, check_model=False)
"""The jackknife serves intervals, which most experiments do not look at."""


@dataclass(frozen=True, eq=False)
class Reconstruction:
    """Surface in the first camera's frame, mm."""

    surface: SurfaceEstimate
    focals: list[float]
    """Pattern pixels; one, or one a frame."""
    frames: int
    """That the method used."""
    seconds: float = 0.0


Method = Callable[[Path], Reconstruction]


AT_ONE_PLACE = replace(LEAN, cameras="identity")
"""For surfaces that cannot be registered, or cameras that hardly move."""


def focal_of(found: Calibration) -> float:
    """Return the focal length, pattern pixels; NaN where it is not told."""
    value = found.solution.projector.focal.value
    return value if isinstance(value, float) else float("nan")


def joint(inputs: Path, options: Options = LEAN) -> Reconstruction:
    """Solve ours: one surface, one focal length, a projector pose for every frame."""
    return reconstruct(*read_inputs(inputs), options)


def reconstruct(maps: list[CorrespondenceMap], rig: Rig, options: Options) -> Reconstruction:
    """Calibrate as the package does.

    Raises:
        RuntimeError: the first frame, in which surfaces are compared, was left out.
    """
    began = perf_counter()
    found = calibrate(maps, rig, options)
    if found.frames[0].name != maps[0].name:
        raise RuntimeError(f"the first frame was left out of {len(maps)}")
    return Reconstruction(
        found.surface, [focal_of(found)], len(found.frames), perf_counter() - began
    )


def independent(inputs: Path, how: Fusion | None = None) -> Reconstruction:
    """Solve A: every frame calibrated alone, then ICP and TSDF."""
    maps, rig = read_inputs(inputs)
    began = perf_counter()
    alone = [calibrate([m], rig, LEAN) for m in maps]
    ranges = [_range(a.surface, a.camera) for a in alone]
    return Reconstruction(
        fuse(ranges, alone[0].camera, how or Fusion()),
        [focal_of(a) for a in alone], len(maps), perf_counter() - began,
    )  # fmt: skip


def one_projector(inputs: Path, how: Fusion | None = None) -> Reconstruction:
    """Solve B: one projector pose and focal length for all frames, then ICP and TSDF."""
    maps, rig = read_inputs(inputs)
    began = perf_counter()
    rig = rig.model_copy(update={"share": Share(surface="per_frame", projector_pose="shared")})
    found = calibrate(maps, rig, LEAN)
    surfaces = [found.surface, *(found.own_surfaces[k] for k in sorted(found.own_surfaces))]
    ranges = [_range(s, found.camera) for s in surfaces]
    return Reconstruction(
        fuse(ranges, found.camera, how or replace(Fusion(), free_scale=False)),
        [focal_of(found)], len(found.frames),
        perf_counter() - began,
    )  # fmt: skip


def _range(surface: SurfaceEstimate, camera: CameraModel) -> NDArray[np.float64]:
    return range_image(RayCaster(surface.vertices, surface.faces), camera)
