"""Sequences of frames with exact truth: an endoscope drawn through a colon, or over a stomach.

Camera and projector move a little from frame to frame, as in a video: the camera is withdrawn and
sways, the projector creeps along its channel, rolls and wobbles in it. Maps are made when they are
asked for, so that a sequence costs no memory. The world is the first camera's frame. Units mm,
radians, pattern pixels.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.geometry import trajectories
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.endoscope import Endoscope
from mitsuba_endo.geometry.projection_models import ProjectorModel, projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.ground_truth import GroundTruth, TrueFrame
from mitsuba_endo.records.rig import Camera, Rig
from mitsuba_endo.records.solution import Solution
from mitsuba_endo.shapes import Mesh, make_shape
from scripts.reproduce.decoder_noise import DecoderNoise
from tests.lumen import CENTRE, FOCAL, POSE, REACH, SIZE, endoscope

Floats = NDArray[np.float64]
Noise = Callable[[Floats, tuple[int, int], np.random.Generator], Floats]

STEP = 0.5
"""Withdrawal from frame to frame, mm."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A solver is given :meth:`map` of every frame and :meth:`rig`; the rest is truth."""

    mesh: Mesh
    """The true surface, world."""
    camera: CameraModel
    projector: ProjectorModel
    world_from_camera: list[RigidTransform]
    projector_from_camera: list[RigidTransform]
    noise: Noise
    seed: int = 0

    def __len__(self) -> int:
        return len(self.world_from_camera)

    @cached_property
    def _scene(self) -> Any:
        backend.use("llvm_ad_rgb")
        from mitsuba_endo.rendering.synthetic import MeshScene

        return MeshScene(self.mesh.vertices, self.mesh.faces)

    def exact(self, k: int) -> tuple[Floats, Floats]:
        """Return coordinates (H, W, 2) and points (H, W, 3) in the camera's frame; NaN = none."""
        pose, own = self.world_from_camera[k], self.projector_from_camera[k]
        seen = self._scene.view(self.camera, pose, self.projector, own, SIZE)
        near = np.linalg.norm(seen.points, axis=-1, keepdims=True) < REACH
        return np.where(near, seen.q, np.nan), seen.points

    def map(self, k: int) -> CorrespondenceMap:
        """Return what a decoder reads of frame k."""
        rng = np.random.default_rng([self.seed, k])
        q = self.noise(self.exact(k)[0], SIZE, rng).astype(np.float32)
        return CorrespondenceMap(q, f"frame{k:04d}")

    def maps(self, only: Sequence[int] | None = None) -> Iterator[CorrespondenceMap]:
        """Yield the maps, one after the other."""
        yield from (self.map(k) for k in (range(len(self)) if only is None else only))

    @property
    def truth(self) -> Solution:
        """What ``evaluate`` compares with; the world is the first camera."""
        poses = zip(self.world_from_camera, self.projector_from_camera, strict=True)
        frames = [
            TrueFrame(f"frame{k:04d}", Endoscope(self.camera, at, self.projector, own))
            for k, (at, own) in enumerate(poses)
        ]
        return GroundTruth(frames, SIZE).to_solution()

    @property
    def surface(self) -> SurfaceEstimate:
        """The true one, without deviations."""
        return SurfaceEstimate(self.mesh.vertices.astype(float), self.mesh.faces)

    def rig(self, **changes: object) -> Rig:
        """A rig file that knows camera, pattern, first baseline and how the projector drifts."""
        data = {
            "camera": Camera.from_model(self.camera),
            "projector": {
                "law": self.projector.law, "width": SIZE[0], "height": SIZE[1],
                "centre": list(CENTRE),
            },
            "scale": {"baseline": float(np.linalg.norm(self.projector_from_camera[0].t))},
            "drift": {
                "insertion_mm": 0.05, "roll_deg": 0.2, "lateral_mm": 0.02, "tilt_deg": 0.1,
            },
        }  # fmt: skip
        return Rig.model_validate({**data, **changes})


def exact(q: Floats, _size: tuple[int, int], _rng: np.random.Generator) -> Floats:
    """No noise."""
    return q


def withdrawal(
    count: int = 16,
    *,
    width: int = 160,
    height: int = 120,
    step: float = STEP,
    noise: Noise | None = None,
    seed: int = 0,
) -> Recording:
    """Withdraw an endoscope through a folded, closed colon.

    Args:
        count: frames.
        width: of the camera, pixels.
        height: of the camera, pixels.
        step: from frame to frame, mm.
        noise: default: as of the grid's decoder, slips and missing patches included.
        seed: of surface, motion and noise.
    """
    mesh = make_shape(
        "colon", length=24.0, behind=step * count + 25.0, radius=22.0, bend=0.28, bend_towards=0.6,
        fold_depth=6.0, fold_spacing=19.0, fold_width=3.0, tenia_depth=1.5, edge=1.0, seed=seed,
    )  # fmt: skip
    rng = np.random.default_rng([seed, 1])
    cameras = trajectories.withdrawal(count, rng, step)
    return Recording(
        mesh, endoscope(width, height), projector_model("direction_cosine", FOCAL, CENTRE),
        cameras, _creeping(count, rng), noise or DecoderNoise().apply, seed,
    )  # fmt: skip


def pan(
    count: int = 16,
    *,
    width: int = 160,
    height: int = 120,
    noise: Noise | None = None,
    seed: int = 0,
    radius: float = 15.0,
) -> Recording:
    """Look over a stomach's wall from a circle that ends where it began."""
    mesh = make_shape("stomach", distance=55.0, angle_x=1.3, angle_y=1.2, edge=1.0, seed=seed)
    rng = np.random.default_rng([seed, 2])
    cameras = trajectories.pan(count, rng, radius)
    return Recording(
        mesh, endoscope(width, height), projector_model("direction_cosine", FOCAL, CENTRE),
        cameras, _creeping(count, rng), noise or DecoderNoise().apply, seed,
    )  # fmt: skip


def _creeping(count: int, rng: np.random.Generator) -> list[RigidTransform]:
    """A projector that creeps by 2 mm and rolls by 5 degrees in 300 frames, and wobbles."""
    return [moved @ POSE for moved in trajectories.creeping(count, rng)]
