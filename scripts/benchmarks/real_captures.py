"""Real captures of a projector-camera rig, each alone, from no guess of focal length and pose."""

from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mitsuba_endo.geometry.transforms import angle_between, rotation_angle
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale
from mitsuba_endo.records.solution import Solution
from mitsuba_endo.solve.calibrate import calibrate

from .report import Figure

NAME = "real"
CAPTURES = Path(__file__).parents[3] / "shared" / "real" / "kamino"
_figure = partial(Figure, NAME)
_KNOWN = ("K_cam", "dist_cam", "cam_size", "dist_proj", "proj_size")
_TRUTH = ("K_proj", "R", "t")


def run(quick: bool) -> list[Figure]:
    """Calibrate every capture that is present; none where the folder is absent."""
    paths = sorted(CAPTURES.glob("capture_*_small.npz"))
    return [f for path in (paths[:1] if quick else paths) for f in _capture(path)]


def _capture(path: Path) -> list[Figure]:
    with np.load(path) as file:
        arrays = {name: file[name] for name in (*_KNOWN, *_TRUTH)}
    found = calibrate([load_map(path)], _rig(arrays)).solution
    pose = found.frames[0].projector_from_camera.to_transform()
    focal = found.projector.focal.value
    if pose is None or not isinstance(focal, float):
        raise RuntimeError(f"{path.name}: focal length or pose was not determined")
    std = found.projector.focal.std
    error = Rotation.from_matrix(pose.R @ arrays["R"].T).as_rotvec(), pose.t - arrays["t"].ravel()
    of_pose = np.abs(np.concatenate(error)) / _std(found)
    of_focal = (
        abs(focal - float(arrays["K_proj"][0, 0])) / std if isinstance(std, float) else np.inf
    )
    name = path.stem.removesuffix("_small").replace("_", " ")
    true_focal = float(arrays["K_proj"][0, 0])
    turned = np.degrees(rotation_angle(pose.R @ arrays["R"].T))
    moved = np.degrees(angle_between(pose.t, arrays["t"]))
    return [
        _figure(f"{name}: focal error", 100 * abs(focal / true_focal - 1), "%", "lower", 1),
        _figure(f"{name}: rotation error", float(turned), "deg", "lower", 0.3),
        _figure(f"{name}: translation direction error", float(moved), "deg", "lower", 2),
        _figure(f"{name}: focal error, in deviations", float(of_focal), "", "lower", 1.96),
        _figure(f"{name}: pose error, worst component", float(of_pose.max()), "",
                "lower", 3),
    ]  # fmt: skip


def _std(found: Solution) -> NDArray:
    """Return the stated deviations (6,) of the projector's pose."""
    return np.array(found.frames[0].projector_from_camera.std or [1e-300] * 6)


def _rig(arrays: dict[str, NDArray]) -> Rig:
    """Return what is given: camera, projector centre, aspect and distortion, and the baseline."""
    K = arrays["K_proj"]
    width, height = (int(n) for n in arrays["cam_size"])
    return Rig(
        camera=Camera(
            width=width, height=height, K=arrays["K_cam"].tolist(),
            distortion=arrays["dist_cam"].tolist(),
        ),
        projector=Projector(
            law="pinhole", width=int(arrays["proj_size"][0]), height=int(arrays["proj_size"][1]),
            focal=Focal(), centre=[K[0, 2], K[1, 2]], aspect=K[1, 1] / K[0, 0],
            distortion=arrays["dist_proj"].tolist(),
        ),
        scale=Scale(baseline=float(np.linalg.norm(arrays["t"]))),
    )  # fmt: skip
