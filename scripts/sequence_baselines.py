"""A short withdrawal, tracked, calibrated jointly, and solved frame by frame and registered.

python -m scripts.sequence_baselines

The published way A solves every frame alone and puts the range images together by registration
and ICP; here the package's own registration does it, and small_gicp's ICP where it is installed.
"""

import importlib.util
from collections.abc import Callable
from time import perf_counter
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.evaluate.trajectory_errors import absolute_trajectory_error, trajectory_alignment
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.range_image import RangeImage
from mitsuba_endo.initialisation.registration import register_frames
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.sequence.run import run_sequence
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from scripts.reproduce.fusion import Fusion, _icp
from tests.sequences import Recording, withdrawal

Poses = dict[int, RigidTransform]
"""world_from_camera of the frames that a method placed, by their numbers."""
LEAN = Options(jackknife=False, check_model=False)


def main(
    frames: Annotated[int, typer.Option(help="Of the withdrawal.")] = 16,
    step: Annotated[float, typer.Option(help="From frame to frame, mm.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Of surface, motion and noise.")] = 0,
) -> None:
    """Print how far each method's cameras are from the truth."""
    backend.use("llvm_ad_rgb")
    recording = withdrawal(frames, step=step, seed=seed)
    methods: dict[str, Callable[[Recording], Poses]] = {
        "sequence": tracked, "calibrate, one mesh": jointly, "frame by frame, registered": alone,
    }  # fmt: skip
    for name, method in methods.items():
        began = perf_counter()
        poses = method(recording)
        told = _errors(poses, recording) if len(poses) >= 3 else "too few to compare"
        seconds = perf_counter() - began
        typer.echo(f"{name}: {len(poses)} of {frames} frames, {told}, {seconds:.0f} s")


def tracked(recording: Recording) -> Poses:
    rows = run_sequence(recording.maps(), recording.rig()).rows
    return {r.number: r.world_from_camera for r in rows if r.world_from_camera is not None}


def jointly(recording: Recording) -> Poses:
    options = Options(surface="mesh", jackknife=False, check_model=False)
    found = calibrate(list(recording.maps()), recording.rig(), options).solution
    poses = {int(f.name[5:]): f.world_from_camera.to_transform() for f in found.frames}
    return {k: pose for k, pose in poses.items() if pose is not None}


def alone(recording: Recording) -> Poses:
    """Solve A; the scale of each frame is that of the one baseline given for all."""
    from scripts.reproduce.methods import _range

    rig = recording.rig(drift=None)
    found = [calibrate([m], rig, LEAN) for m in recording.maps()]
    surfaces: list[SurfaceEstimate] = [f.surface for f in found]
    camera = recording.camera
    ranges = [_range(s, camera) for s in surfaces]
    rays = camera.grid_rays
    placed = register_frames([RangeImage(rays, r, camera) for r in ranges])
    poses: Poses = {}
    clouds = [_points(rays, r) for r in ranges]
    model = clouds[0]
    first = placed[0]
    for k, at in enumerate(placed):
        if not at.reliable:
            continue
        guess = first.world_from_camera.inverse() @ at.world_from_camera
        pose = RigidTransform(guess.R, guess.t / first.scale)
        if k and importlib.util.find_spec("small_gicp"):
            pose = _icp(model, clouds[k], pose, Fusion().reach)
            model = np.concatenate([model, pose.apply(clouds[k])])
        poses[k] = pose
    return poses


def _points(rays: NDArray[np.float64], ranges: NDArray[np.float64]) -> NDArray[np.float64]:
    return (rays * ranges[..., None])[np.isfinite(ranges)]


def _errors(poses: Poses, recording: Recording) -> str:
    found = list(poses.values())
    true = [recording.world_from_camera[k] for k in poses]
    parts = []
    for how in ("rigid", "none"):
        by = trajectory_alignment(found, true, how)
        rms = np.sqrt(np.mean(absolute_trajectory_error(found, true, by) ** 2))
        parts.append(
            f"{rms:.3f} mm {'aligned' if how == 'rigid' else 'with first cameras put together'}"
        )
    return ", ".join(parts)


if __name__ == "__main__":
    typer.run(main)
