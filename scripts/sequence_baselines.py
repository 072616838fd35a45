"""A short withdrawal, tracked, calibrated jointly, and solved frame by frame and registered.

python -m scripts.sequence_baselines

The published way A solves every frame alone and puts the range images together by registration
and ICP; here the package's own registration does it, and small_gicp's ICP where it is installed.
"""

import importlib.util
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.evaluate.sequence_errors import evaluate_sequence
from mitsuba_endo.evaluate.sequence_metrics import SequenceMetrics
from mitsuba_endo.evaluate.tracked_frames import TrackedFrames
from mitsuba_endo.fusion import RangeFrame, fuse
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.range_image import RangeImage
from mitsuba_endo.initialisation.registration import register_frames
from mitsuba_endo.records.calibration import Calibration, SurfaceEstimate
from mitsuba_endo.records.trajectory import FrameRow
from mitsuba_endo.sequence.outcome import outcome_of
from mitsuba_endo.sequence.run import run_sequence
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from scripts.reproduce.fusion import Fusion, _icp
from tests.sequences import Recording, withdrawal

MOST = 16
"""Frames that are calibrated together, spread over all."""
LEAN = Options(jackknife=False, check_model=False)


def main(
    frames: Annotated[int, typer.Option(help="Of the withdrawal.")] = 16,
    step: Annotated[float, typer.Option(help="From frame to frame, mm.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Of surface, motion and noise.")] = 0,
) -> None:
    """Print how far each method's cameras are from the truth."""
    backend.use("llvm_ad_rgb")
    recording = withdrawal(frames, step=step, seed=seed)
    for name, method in METHODS.items():
        began = perf_counter()
        found = method(recording)
        seconds = perf_counter() - began
        if len(found.placed) < 3:
            typer.echo(f"{name}: {len(found.placed)} frames, too few to compare, {seconds:.0f} s")
            continue
        m = errors(found, recording)
        typer.echo(
            f"{name}: {m.frames} of {frames} frames, {m.ate_aligned_rms_mm:.3f} mm aligned, "
            f"{m.ate_first_rms_mm:.3f} mm with first cameras put together, surface "
            f"{m.surface_rms_mm:.3f} mm of {m.completeness_percent:.0f} %, {seconds:.0f} s"
        )


def errors(found: TrackedFrames, recording: Recording) -> SequenceMetrics:
    """Compare what a method placed with the truth."""
    return evaluate_sequence(found, recording.truth, recording.surface)


def tracked(recording: Recording) -> TrackedFrames:
    result = outcome_of(run_sequence(recording.maps(), recording.rig()))
    mesh = result.surfaces[result.main]
    surface = None if mesh is None else SurfaceEstimate(mesh.vertices, mesh.faces, mesh.std)
    return TrackedFrames(result.solution, result.rows, surface)


def jointly(recording: Recording) -> TrackedFrames:
    count = len(recording)
    chosen = np.unique(np.linspace(0, count - 1, min(MOST, count)).astype(int)).tolist()
    options = Options(surface="mesh", jackknife=False, check_model=False)
    found = calibrate(list(recording.maps(chosen)), recording.rig(), options)
    frames = found.solution.frames
    rows = [
        FrameRow(int(frame.name[5:]), frame.name,
                 world_from_camera=frame.world_from_camera.to_transform(),
                 projector_from_camera=frame.projector_from_camera.to_transform())
        for frame in frames
    ]  # fmt: skip
    return TrackedFrames(found.solution, rows, found.surface)


def alone(recording: Recording) -> TrackedFrames:
    """Solve A; the scale of each frame is that of the one baseline given for all."""
    from scripts.reproduce.methods import _range

    rig = recording.rig(drift=None)
    found = [calibrate([m], rig, LEAN) for m in recording.maps()]
    camera = recording.camera
    ranges = [_range(f.surface, camera) for f in found]
    poses = _registered(ranges, recording)
    frames = [RangeFrame(ranges[k], camera, pose) for k, pose in poses.items()]
    mesh = fuse(frames)
    rows = [
        FrameRow(k, f"frame{k:04d}", world_from_camera=pose,
                 projector_from_camera=_projector(found[k]))
        for k, pose in poses.items()
    ]  # fmt: skip
    return TrackedFrames(found[0].solution, rows, SurfaceEstimate(mesh.vertices, mesh.faces))


METHODS: dict[str, Callable[[Recording], TrackedFrames]] = {
    "sequence": tracked,
    "calibrate, one mesh": jointly,
    "frame by frame, registered": alone,
}


def _registered(
    ranges: Sequence[NDArray[np.float64]], recording: Recording
) -> dict[int, RigidTransform]:
    """Return world_from_camera of the frames that registration places, refined by ICP."""
    camera = recording.camera
    rays = camera.grid_rays
    placed = register_frames([RangeImage(rays, r, camera) for r in ranges])
    poses: dict[int, RigidTransform] = {}
    clouds = [_points(rays, r) for r in ranges]
    model, first = clouds[0], placed[0]
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


def _projector(found: Calibration) -> RigidTransform | None:
    return found.solution.frames[0].projector_from_camera.to_transform()


def _points(rays: NDArray[np.float64], ranges: NDArray[np.float64]) -> NDArray[np.float64]:
    return (rays * ranges[..., None])[np.isfinite(ranges)]


if __name__ == "__main__":
    typer.run(main)
