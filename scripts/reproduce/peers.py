"""Peers: the same maps in; focal length, the first frame's pose and points out.

All start from the same wrong focal length. The first-order solver and pycolmap get the published
start, a plane and a front-parallel projector; the others need none.
"""

import resource
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.search import search_start
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

from .bundle import Model, adjust
from .capture import read_inputs
from .clouds import cloud_image

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Found:
    """What a peer found."""

    focal: float
    pose: RigidTransform
    """projector_from_camera, mm."""
    ranges: Floats
    """(H, W) along the unit camera rays, mm, NaN = none."""
    seconds: float
    memory_mb: float
    """Peak of the process so far."""


def ours(inputs: Path) -> Found:
    """Solve by this package's default: search, then Gauss-Newton."""
    return _calibrated(inputs, Options(jackknife=False))


def adam(inputs: Path, plane: float = 8.0, iterations: int = 3000) -> Found:
    """Solve by the published method: Adam from a plane and a front-parallel projector."""
    return _calibrated(
        inputs,
        Options(solver="adam", start="plane", plane_distance=plane, adam_iterations=iterations,
                finish="cauchy", jackknife=False),
    )  # fmt: skip


def epipolar(inputs: Path) -> Found:
    """Fit the epipolar geometry and triangulate pixel by pixel: this package's start alone."""
    (map_,), rig, camera = _one(inputs)
    began = perf_counter()
    size = (rig.projector.width, rig.projector.height)
    start = search_start(
        map_.q, camera, rig.projector.to_model(), size, focal_guess=rig.projector.focal.value
    )
    scale = _baseline(rig)
    pose = RigidTransform(start.projector_from_camera.R, scale * start.projector_from_camera.t)
    return _found(float(start.projector.focal), pose, scale * start.depth, began)


def pycolmap_pinhole(inputs: Path, plane: float = 8.0) -> Found:
    """Solve by COLMAP's bundle adjustment, the projector a pinhole camera."""
    return _bundle(inputs, "SIMPLE_PINHOLE", plane)


def pycolmap_fisheye(inputs: Path, plane: float = 8.0) -> Found:
    """Solve likewise, the projector a fisheye camera frozen to the sine law."""
    return _bundle(inputs, "RADIAL_FISHEYE", plane)


def _calibrated(inputs: Path, options: Options) -> Found:
    maps, rig = read_inputs(inputs)
    camera = rig.camera.to_model()
    began = perf_counter()
    found = calibrate(maps, rig, options)
    focal = found.solution.projector.focal.value
    pose = found.solution.frames[0].projector_from_camera.to_transform()
    if not isinstance(focal, float) or pose is None:
        raise RuntimeError("the focal length or pose is unobservable")
    seconds = perf_counter() - began
    ranges = cloud_image(found.surface, camera)
    return replace(_found(focal, pose, ranges, began), seconds=seconds)


def _bundle(inputs: Path, model: Model, plane: float) -> Found:
    (map_,), rig, camera = _one(inputs)
    began = perf_counter()
    found = adjust(map_.q, camera, rig, plane * _baseline(rig), model)
    ranges = np.full(map_.valid.shape, np.nan)
    rays = camera.grid_rays[map_.valid]
    ranges[map_.valid] = np.einsum("ni,ni->n", found.points, rays)
    return _found(found.focal, found.pose, ranges, began)


def _one(inputs: Path) -> tuple[list, Rig, CameraModel]:
    maps, rig = read_inputs(inputs)
    return maps[:1], rig, rig.camera.to_model()


def _baseline(rig: Rig) -> float:
    assert rig.scale.baseline is not None
    return rig.scale.baseline


def _found(focal: float, pose: RigidTransform, ranges: Floats, began: float) -> Found:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return Found(focal, pose, ranges, perf_counter() - began, peak)
