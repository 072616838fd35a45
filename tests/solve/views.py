"""Several views of one surface, or of several, with their truth, to test the joint solver on.

Surfaces and rays are those of :mod:`tests.range_scenes`, NumPy marching that shares no code with
the renderer. The camera is small, non-square and distorted; the projector's centre is off the
middle of a non-square pattern. Units mm, radians, pattern pixels.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import ProjectorModel, projector_model
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_angle
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Rig
from mitsuba_endo.records.solution import Frame, Outcome, Solution
from tests.range_scenes import Surface, cast, height_field
from tests.rigs import lopsided_camera

SIZE = (512, 400)
CENTRE = (262.0, 189.0)
FOCAL = 470.0
POSE = RigidTransform.of([0.03, -0.12, 0.05], [-6.0, 1.0, 1.5])
"""projector_from_camera of the first frame."""


@dataclass(frozen=True, eq=False)
class Views:
    """What a solver is given, and the truth apart from it."""

    maps: list[CorrespondenceMap]
    camera: CameraModel
    projector: ProjectorModel
    world_from_camera: list[RigidTransform]
    projector_from_camera: list[RigidTransform]
    points: list[NDArray[np.float64]]
    """(H, W, 3) seen by each camera, in its frame."""
    size: ClassVar[tuple[float, float]] = SIZE
    centre: ClassVar[tuple[float, float]] = CENTRE
    """Of the pattern and the projector, pattern pixels."""

    @property
    def baseline(self) -> float:
        return float(np.linalg.norm(self.projector_from_camera[0].t))

    def rig(self, **changes: object) -> Rig:
        """A rig file that knows the cameras, the pattern and the first baseline."""
        data = {
            "camera": Camera.from_model(self.camera),
            "projector": {
                "law": self.projector.law, "width": self.size[0], "height": self.size[1],
                "centre": list(self.centre),
            },
            "scale": {"baseline": self.baseline},
        }  # fmt: skip
        return Rig.model_validate({**data, **changes})

    def with_map(self, index: int, q: NDArray[np.float64], name: str = "") -> "Views":
        """Return views with the map of one frame replaced."""
        maps = list(self.maps)
        maps[index] = CorrespondenceMap(q.astype(np.float32), name or maps[index].name)
        return replace(self, maps=maps)


def relief(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """A tilted sheet at 70 mm with waves that repeat nowhere in view, some 12 mm high."""
    waves = 3.5 * np.sin(x / 9 + 0.4) * np.cos(y / 11) + 2.5 * np.sin((x + 2 * y) / 21 + 1)
    return 70 + 0.15 * x - 0.1 * y + waves + 2 * np.cos(x / 5 - y / 8)


def relief_surface() -> Surface:
    return height_field(relief)


def steps(count: int, seed: int = 0) -> list[RigidTransform]:
    """Camera poses: the first at the origin, the others some 8 mm and 5 degrees from it."""
    rng = np.random.default_rng(seed)
    moves = [
        RigidTransform.of(rng.normal(0, 0.06, 3), [*rng.normal(0, 6, 2), rng.normal(0, 2.5)])
        for _ in range(count - 1)
    ]
    return [RigidTransform.identity(), *moves]


def projector_poses(count: int, seed: int = 1) -> list[RigidTransform]:
    """A projector that moves in its channel by some 0.4 mm and one degree from frame to frame."""
    rng = np.random.default_rng(seed)
    turn = np.array([0.03, -0.12, 0.05])
    moved = [
        RigidTransform.of(turn + rng.normal(0, 0.02, 3), POSE.t + rng.normal(0, 0.4, 3))
        for _ in range(count - 1)
    ]
    return [POSE, *moved]


def look(
    surfaces: Surface | Sequence[Surface],
    world_from_camera: list[RigidTransform],
    projector_from_camera: list[RigidTransform],
    *,
    law: str = "pinhole",
    width: int = 108,
    noise: float = 0.1,
    outliers: float = 0.02,
    seed: int = 0,
) -> Views:
    """Capture one surface, or one a frame, with ``noise`` pattern pixels and gross outliers."""
    camera, rng = lopsided_camera(width, width * 7 // 9), np.random.default_rng(seed)
    projector = projector_model(law, FOCAL, CENTRE)
    rays = camera.rays(camera.pixel_grid())
    maps, points = [], []
    for k, (pose, own) in enumerate(zip(world_from_camera, projector_from_camera, strict=True)):
        surface = surfaces[k] if isinstance(surfaces, Sequence) else surfaces
        at = cast(surface, pose, rays)[..., None] * rays
        q = projector.project(own.apply(at))
        q = np.where(((q >= 0) & (q <= np.array(SIZE) - 1)).all(-1, keepdims=True), q, np.nan)
        q = q + noise * rng.standard_normal(q.shape)
        gross = rng.random(q.shape[:2]) < outliers
        q[gross] += 30 * rng.standard_normal((gross.sum(), 2))
        maps.append(CorrespondenceMap(q.astype(np.float32), f"view{k}"))
        points.append(at)
    return Views(maps, camera, projector, world_from_camera, projector_from_camera, points)


def several(surface: Surface, count: int) -> Views:
    """Views of one surface, each with a projector pose of its own."""
    return look(surface, steps(count), projector_poses(count))


@dataclass(frozen=True)
class Errors:
    """How far one frame of a solution is from the truth."""

    baseline: float
    """Relative."""
    projector: float
    """Rotation of the projector, degrees."""
    towards: float
    """Direction of the projector's translation, degrees."""
    camera: float
    """Rotation of the camera, degrees."""
    position: float
    """Position of the camera, mm."""


def frame_errors(views: Views, frame: Frame) -> Errors:
    """Compare one frame of a solution with the views' truth; frames are found by name."""
    k = [m.name for m in views.maps].index(frame.name)
    mine, camera = (
        frame.projector_from_camera.to_transform(),
        frame.world_from_camera.to_transform(),
    )
    assert mine is not None
    assert camera is not None
    true, at = views.projector_from_camera[k], views.world_from_camera[k]
    lengths = np.linalg.norm(mine.t), np.linalg.norm(true.t)
    cosine = mine.t @ true.t / (lengths[0] * lengths[1])
    return Errors(
        float(lengths[0] / lengths[1] - 1),
        float(np.degrees(rotation_angle(mine.R @ true.R.T))),
        float(np.degrees(np.arccos(min(cosine, 1.0)))),
        float(np.degrees(rotation_angle(camera.R @ at.R.T))),
        float(np.linalg.norm(camera.t - at.t)),
    )


def focal_error(solution: Solution) -> float:
    """Relative error of the focal length."""
    value = solution.projector.focal.value
    assert isinstance(value, float)
    return value / FOCAL - 1


def assert_near(
    views: Views, solution: Solution, *, focal: float = 2e-3, baseline: float = 5e-3
) -> None:
    """Converged, and every frame that is part of it is within its physical limits."""
    assert solution.outcome is Outcome.CONVERGED
    assert abs(focal_error(solution)) < focal
    for frame in solution.frames:
        error = frame_errors(views, frame)
        assert abs(error.baseline) < baseline, frame.name
        assert error.towards < 0.5, frame.name
        assert error.position < 0.2, frame.name
