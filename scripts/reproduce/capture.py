"""Synthetic captures in two folders: what a solver may read, and apart from it the truth."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo import backend
from mitsuba_endo.evaluate.shape import Lighting
from mitsuba_endo.files import atomic_path
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.records.correspondence import CorrespondenceMap, load_map, save_map
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale, load_rig
from mitsuba_endo.rendering.synthetic import MeshScene
from mitsuba_endo.shapes.mesh import Mesh

from .decoder_noise import DecoderNoise

INPUTS, TRUTH = "inputs", "truth"
Errors = Callable[[NDArray[np.float64], int], NDArray[np.float64]]
"""From exact coordinates (H, W, 2) and the frame's number to what is read."""


@dataclass(frozen=True, eq=False)
class Truth:
    """What only the evaluation knows."""

    mesh: Mesh
    """In the world, which is the first camera's frame."""
    camera: CameraModel
    projector: ProjectorModel
    size: tuple[int, int]
    """Of the pattern, pixels."""
    world_from_camera: list[RigidTransform]
    projector_from_camera: list[RigidTransform]

    @property
    def baseline(self) -> float:
        """Of the first frame, mm."""
        return float(np.linalg.norm(self.projector_from_camera[0].t))

    @property
    def surface(self) -> SurfaceEstimate:
        return SurfaceEstimate(self.mesh.vertices, self.mesh.faces)

    @property
    def lighting(self) -> Lighting:
        return Lighting(self.projector, self.size, self.projector_from_camera[0])

    def rig(self, focal_guess: float, *, scale_error: float = 1.0, scale_std: float = 0.0) -> Rig:
        """Return what a solver is told: camera, pattern, law, and the first frame's baseline.

        Args:
            focal_guess: starting focal length, pattern pixels.
            scale_error: the baseline told over the true one.
            scale_std: its standard deviation that is told, relative.
        """
        said = scale_error * self.baseline
        return Rig(
            camera=Camera.from_model(self.camera),
            projector=Projector(
                law=self.projector.law, width=self.size[0], height=self.size[1],
                focal=Focal(value=focal_guess), centre=list(self.projector.centre),
            ),
            scale=Scale(baseline=said, baseline_std=scale_std * said),
        )  # fmt: skip


@dataclass(frozen=True)
class Capture:
    """A capture's folder; a solver is given :attr:`inputs` alone."""

    folder: Path

    @property
    def inputs(self) -> Path:
        return self.folder / INPUTS


def capture(truth: Truth, rig: Rig, errors: Errors, folder: Path) -> Capture:
    """Look at the scene from every place; write maps and rig, and the true surface apart."""
    backend.ensure()
    scene = MeshScene(truth.mesh.vertices, truth.mesh.faces)
    for k, (at, lit) in enumerate(
        zip(truth.world_from_camera, truth.projector_from_camera, strict=True)
    ):
        q = scene.view(truth.camera, at, truth.projector, lit, truth.size).q
        save_map(folder / INPUTS / f"frame_{k}.npz", errors(q, k))
    write_rig(folder / INPUTS / "rig.yaml", rig)
    (folder / TRUTH).mkdir(parents=True, exist_ok=True)
    truth.mesh.save(folder / TRUTH / "surface.ply")
    return Capture(folder)


def decoded(truth: Truth, rig: Rig, seed: int, folder: Path) -> Capture:
    """Make a capture whose maps have the errors of a decoder."""
    rng = np.random.default_rng(seed)
    return capture(truth, rig, lambda q, _: DecoderNoise().apply(q, truth.size, rng), folder)


def write_rig(path: Path, rig: Rig) -> None:
    """Write a rig file (JSON is YAML)."""
    with atomic_path(path) as aside:
        aside.write_text(rig.model_dump_json(indent=1), encoding="utf-8")


def read_inputs(inputs: Path) -> tuple[list[CorrespondenceMap], Rig]:
    """Read all that a solver gets."""
    paths = sorted(inputs.glob("frame_*.npz"), key=lambda p: int(p.stem.split("_")[1]))
    return [load_map(path) for path in paths], load_rig(inputs / "rig.yaml")


def wandering(
    count: int, rng: np.random.Generator, turn: float, step: Sequence[float]
) -> list[RigidTransform]:
    """Return camera poses: the identity, then others spread by ``turn`` rad and ``step`` mm."""
    return [RigidTransform.identity()] + [
        RigidTransform.of(rng.normal(0, turn, 3), rng.normal(0, step)) for _ in range(count - 1)
    ]


def in_channel(
    count: int, rng: np.random.Generator, at: RigidTransform, play: float = 1.0
) -> list[RigidTransform]:
    """Return projector_from_camera of a projector that slides, rolls and tilts in its channel.

    ``play`` scales the spread: 0.5 mm along the axis and 0.15 mm across, 2 degrees about the axis
    and 0.6 degrees of it, which a thin instrument in a wider channel has.
    """
    return [at] + [
        RigidTransform.of(
            rng.normal(0, play * np.radians([0.6, 0.6, 2.0])),
            rng.normal(0, play * np.array([0.15, 0.15, 0.5])),
        )
        @ at
        for _ in range(count - 1)
    ]


def pinhole_camera(width: int, height: int, half_angle: float) -> CameraModel:
    """Return a camera whose image is ``half_angle`` rad wide from the middle to the side."""
    f = width / 2 / np.tan(half_angle)
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    return CameraModel("opencv", width, height, K)
