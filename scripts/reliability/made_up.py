"""A small made-up calibration of two frames, with everything that a solution folder may hold."""

import numpy as np

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import (
    Calibration,
    FrameMaps,
    Snapshot,
    SurfaceEstimate,
    TraceRow,
)
from mitsuba_endo.records.checkpoint import Checkpoint, SurfaceRecord
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.solution import (
    Alternative,
    Estimate,
    Frame,
    LeftOut,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
)

WIDTH, HEIGHT, FOCAL = 40, 30, 300.0
POSE = RigidTransform.of([0.06, -0.11, 0.04], [-6.0, 1.4, 0.5])
STEPS = (RigidTransform.identity(), RigidTransform.of([0.02, -0.03, 0.05], [2.0, -1.0, 1.0]))
NAMES = ("run/a.exr", "run/b.exr")


def made_up() -> Calibration:
    """Return the calibration."""
    K = np.array([[34.0, 0, 19.0], [0, 34.5, 15.0], [0, 0, 1]])
    camera = CameraModel("opencv", WIDTH, HEIGHT, K, (-0.1, 0.02))
    surface = _surface()
    frames = [_frame(name, k) for k, name in enumerate(NAMES)]
    history = [_snapshot(i, surface) for i in range(3)]
    trace = [TraceRow(i, 0.1 * i, 1.0 / (i + 1), FOCAL, 0.1, 1.0, 0.3**i) for i in range(4)]
    return Calibration(
        _solution(camera), camera, surface, frames, trace, _checkpoint(surface), history=history
    )


def _surface() -> SurfaceEstimate:
    x, y = np.meshgrid(np.linspace(-45, 40, 16), np.linspace(-35, 38, 14))
    z = 70 - (x**2 + y**2) / 260 + 3 * np.sin(x / 9)
    corner = (np.arange(13)[:, None] * 16 + np.arange(15)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 16, corner + 1], -1),
         np.stack([corner + 1, corner + 16, corner + 17], -1)]
    )  # fmt: skip
    std = 0.02 + 0.1 * (np.hypot(x, y) / 60) ** 2
    modes = np.random.default_rng(0).normal(size=(x.size, 6)) * 0.01
    return SurfaceEstimate(np.stack([x, y, z], -1).reshape(-1, 3), faces, std.ravel(), modes)


def _frame(name: str, k: int) -> FrameMaps:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    rendered = np.stack([5.0 * x + 20 + k, 3.5 * y + 9], -1).astype(np.float32)
    observed = rendered + np.random.default_rng(k).normal(0, 0.2, rendered.shape).astype(np.float32)
    observed[3:5, 4:9] = np.nan
    return FrameMaps(name, observed, rendered, np.isfinite(observed[..., 0]))


def _snapshot(i: int, surface: SurfaceEstimate) -> Snapshot:
    corners = surface.vertices[[0, 15, -16, -1]] * (1 + 0.1 / (i + 1))
    faces = [np.array([[0, 1, 2], [2, 1, 3]])]
    cost = None if i == 0 else 1.0 / i
    return Snapshot(
        i, cost, cost, [FOCAL] * 2, [corners], faces, [s.inverse() for s in STEPS], [POSE] * 2
    )


def _checkpoint(surface: SurfaceEstimate) -> Checkpoint:
    count = len(surface.vertices)
    index = np.stack(np.divmod(np.arange(count), 16), -1)
    lattice = {"cell": np.array(0.05), "ij": index, "faces": surface.faces}
    return Checkpoint(
        law="pinhole", devices="{}", last_stage=True, names=list(NAMES),
        used=[np.ones((HEIGHT, WIDTH), bool)] * 2,
        surfaces=[SurfaceRecord("lattice", lattice, np.full(count, 0.01), 0.1, 1800.0)],
        values={
            "camera_pose": [s.inverse().matrix() for s in STEPS],
            "projector_pose": [POSE.matrix()] * 2, "focal": [np.array([FOCAL])],
        },
    )  # fmt: skip


def _solution(camera: CameraModel) -> Solution:
    pose = PoseEstimate.of(POSE, std=[1e-4] * 3 + [0.01] * 3, std_formal=[1e-4] * 6)
    return Solution(
        outcome=Outcome.CONVERGED, units="mm", scale="baseline", noise_px=0.2,
        scale_std_percent=0.5, verdict=["Focal length measured."], warnings=["A warning"],
        camera=Camera.from_model(camera),
        projector=ProjectorEstimate(
            law="pinhole", width=240, height=120,
            focal=Estimate(value=FOCAL, std=0.4, std_formal=0.3, status="measured"),
            centre=Estimate(value=[118.0, 61.0], status="fixed"),
            aspect=Estimate(value=1.01, status="fixed"),
            distortion=Estimate(value=[0.04], status="fixed"),
        ),
        frames=[
            Frame(
                name=name, projector_from_camera=pose,
                world_from_camera=PoseEstimate.of(step.inverse(), std=[1e-4] * 6), rms_px=0.21,
                used=1100, median_px=0.2, outliers=0.01, slips=2,
            )
            for name, step in zip(NAMES, STEPS, strict=True)
        ],
        left_out=[LeftOut(name="c.exr", reason="no overlap")],
        alternatives=[Alternative(
            frames=list(NAMES), R=POSE.R.tolist(), t=POSE.t.tolist(), focal=310.0, cost_ratio=1.4,
            decided=True, reason="planar twin",
        )],
        law_evidence={"pinhole": 1.0}, observability={"focal": "measured"},
        timings={"solve": 1.2}, versions={"mitsuba": "3.9"}, configuration={"seed": 0},
    )  # fmt: skip
