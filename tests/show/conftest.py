"""A made-up calibration: a bumpy sheet, two frames or more, noise, outliers and a hole."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo import backend
from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import (
    Calibration,
    FrameMaps,
    Snapshot,
    SurfaceEstimate,
    TraceRow,
)
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.solution import (
    Estimate,
    Frame,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
)

NOISE = 0.3
LAW, FOCAL, CENTRE, ASPECT, DISTORTION = "direction_cosine", 900.0, (490.0, 395.0), 1.02, [0.04]
PATTERN = (1024, 768)
PROJECTOR_FROM_CAMERA = RigidTransform.of([0.06, -0.11, 0.04], [-6.0, 1.4, 0.5])


def camera_of(width: int, height: int) -> CameraModel:
    focal = 0.85 * max(width, height)
    K = np.array([[focal, 0, 0.47 * width], [0, 1.01 * focal, 0.52 * height], [0, 0, 1]])
    return CameraModel("opencv", width, height, K, (-0.18, 0.03, 0.001, -0.0005))


def _sheet() -> SurfaceEstimate:
    x, y = np.meshgrid(np.linspace(-48, 44, 150), np.linspace(-42, 47, 140))
    z = 70 - (x**2 + y**2) / 260 + 4 * np.sin(x / 6) * np.cos(y / 8)
    z += 6 * np.exp(-((x - 8) ** 2 + (y + 5) ** 2) / 60)
    rows, columns = x.shape
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + columns, corner + 1], -1),
            np.stack([corner + 1, corner + columns, corner + columns + 1], -1),
        ]
    )
    std = 0.02 + 0.1 * (np.hypot(x, y) / 60) ** 2
    return SurfaceEstimate(np.stack([x, y, z], -1).reshape(-1, 3), faces, std.ravel())


def _frame_maps(
    name: str, surface: SurfaceEstimate, camera: CameraModel, pose: RigidTransform, seed: int
) -> FrameMaps:
    """Maps of the frame ``pose`` = camera_from_first: rendered by ray casting, observed noisy."""
    caster = RayCaster(pose.apply(surface.vertices), surface.faces)
    points = camera.grid_rays * range_image(caster, camera)[..., None]
    projector = projector_model(LAW, FOCAL, CENTRE, ASPECT, DISTORTION)
    rendered = projector.project(PROJECTOR_FROM_CAMERA.apply(points))
    rng = np.random.default_rng(seed)
    observed = rendered + NOISE * rng.normal(size=rendered.shape)
    wrong = rng.random(rendered.shape[:2]) < 0.02
    observed[wrong] = rng.uniform([0, 0], PATTERN, (int(wrong.sum()), 2))
    off = ((observed < 0) | (observed > PATTERN)).any(-1)
    h, w = off.shape
    observed[off] = np.nan
    observed[h // 5 : h // 4, w // 6 : w // 3] = np.nan
    used = np.isfinite(observed).all(-1) & ~wrong
    return FrameMaps(name, observed.astype(np.float32), rendered.astype(np.float32), used)


def _solution(
    camera: CameraModel, frames: list[FrameMaps], poses: list[RigidTransform]
) -> Solution:
    fixed = PoseEstimate.of(PROJECTOR_FROM_CAMERA, std=[1e-4] * 3 + [0.01] * 3)
    return Solution(
        outcome=Outcome.CONVERGED, units="mm", scale="baseline", noise_px=NOISE,
        camera=Camera.from_model(camera),
        projector=ProjectorEstimate(
            law=LAW, width=PATTERN[0], height=PATTERN[1],
            focal=Estimate(value=FOCAL, std=0.42, status="measured"),
            centre=Estimate(value=list(CENTRE), status="fixed"),
            aspect=Estimate(value=ASPECT, status="fixed"),
            distortion=Estimate(value=DISTORTION, status="fixed"),
        ),
        frames=[
            Frame(
                name=f.name, projector_from_camera=fixed,
                world_from_camera=PoseEstimate.of(pose.inverse()), rms_px=0.31,
                used=int(f.used.sum()),
            )
            for f, pose in zip(frames, poses, strict=True)
        ],
    )  # fmt: skip


def _trace() -> list[TraceRow]:
    return [
        TraceRow(
            i, 0.2 * i, 0.5 + 40 * 0.3**i, FOCAL * (1 - 0.1 * 0.4**i), 10.0 ** (-i),
            5.0 if i < 4 else 1.0, 0.3**i, 0.5 + 50 * 0.3**i if i else None,
        )
        for i in range(9)
    ]  # fmt: skip


def _history(surface: SurfaceEstimate, steps: list[RigidTransform]) -> list[Snapshot]:
    """Three snapshots in which surface, cameras and projectors move from 10 % off to the result."""
    faces = [np.array([[0, 1, 2], [2, 1, 3]])]
    corners = surface.vertices[[0, 149, -150, -1]]
    return [
        Snapshot(
            i, None if i == 0 else 1.0 / i, None if i == 0 else 2.0 / i,
            [FOCAL * (1 + off)] * len(steps),
            [(1 + off) * corners], faces, [s.inverse() for s in steps],
            [RigidTransform(PROJECTOR_FROM_CAMERA.R, (1 + off) * PROJECTOR_FROM_CAMERA.t)]
            * len(steps),
        )
        for i, off in enumerate((0.1, 0.03, 0.0))
    ]  # fmt: skip


@pytest.fixture(scope="session")
def make_calibration() -> Callable[..., Calibration]:
    """Return a maker of calibrations for an image size and a number of frames."""

    def make(width: int = 200, height: int = 150, count: int = 1) -> Calibration:
        backend.use("llvm_ad_rgb")
        camera, surface = camera_of(width, height), _sheet()
        steps = [
            RigidTransform.of([0.02 * i, -0.03 * i, 0.05 * i], [2.0 * i, -i, i])
            for i in range(count)
        ]
        names = ["map.npz"] if count == 1 else [f"run/frame_{i}.exr" for i in range(count)]
        frames = [
            _frame_maps(name, surface, camera, step, i)
            for i, (name, step) in enumerate(zip(names, steps, strict=True))
        ]
        return Calibration(
            _solution(camera, frames, steps), camera, surface, frames, _trace(),
            history=_history(surface, steps),
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def with_own_surfaces() -> Callable[[Calibration], Calibration]:
    """Return a function that gives every frame a surface of its own, in its camera's frame."""

    def own(calibration: Calibration) -> Calibration:
        surface = calibration.surface
        moved = {}
        for k, frame in enumerate(calibration.solution.frames[1:], 1):
            pose = frame.world_from_camera.to_transform()
            assert pose is not None
            moved[k] = replace(surface, vertices=pose.inverse().apply(surface.vertices))
        return replace(calibration, own_surfaces=moved)

    return own
