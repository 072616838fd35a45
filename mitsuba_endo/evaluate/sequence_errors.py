"""A tracked sequence against the truth of every frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..records.calibration import SurfaceEstimate
from ..records.solution import INTERVAL, Solution
from ..records.trajectory import FrameRow
from .alignment import Similarity, align
from .depth import RayCaster
from .distance import distance_to_mesh
from .poses import focal_error
from .sequence_metrics import FrameDepth, SequenceMetrics
from .trajectory import absolute_trajectory_error, relative_pose_error, trajectory_alignment

if TYPE_CHECKING:
    from ..rendering.synthetic import MeshScene

Floats = NDArray[np.float64]

APART = 10
"""Frames over which motions are compared."""
NEAR = 1.0
"""mm within which the true surface counts as found."""
SAMPLED = 20
"""Frames, spread over the sequence, whose view of the surface is compared, at most."""
POINTS = 400
"""Of each such frame, by which the true surface that was seen is looked for."""
VERTICES = 20_000
"""Of the surface found that are compared, at most."""


@dataclass(frozen=True, eq=False)
class TrackedFrames:
    """What is compared: the frames of a sequence's largest part."""

    solution: Solution
    rows: Sequence[FrameRow]
    """All frames."""
    surface: SurfaceEstimate | None
    """Of the part, in its world."""

    @cached_property
    def placed(self) -> list[FrameRow]:
        """Frames of the part with the most."""
        with_pose = [row for row in self.rows if not row.lost]
        parts = [row.part for row in with_pose]
        return [row for row in with_pose if row.part == max(set(parts), key=parts.count)]


def evaluate_sequence(
    found: TrackedFrames, truth: Solution, true_surface: SurfaceEstimate | None
) -> SequenceMetrics:
    """Compare poses, surface and intervals with the truth.

    Frames are paired by their names without suffix. Errors that no alignment takes out are in the
    world of the first placed camera. Where the sequence is up to scale, the scale is taken out of
    all lengths with the alignment.

    Args:
        found: of a sequence.
        truth: exact poses of its frames; the world is the first frame's camera, mm.
        true_surface: in this world; None leaves the surface out.

    Raises:
        InputError: fewer than three frames of the truth were placed, or a frame is not in it.
    """
    rows = found.placed
    true = _true_poses(rows, truth)
    if len(rows) < 3:
        raise InputError(
            f"{len(rows)} frames with a pose", "result", "at least three are needed to align them"
        )
    ours = _Pair(rows, true)
    in_mm = found.solution.units == "mm"
    by = trajectory_alignment(ours.found, ours.true, "rigid" if in_mm else "similarity")
    aligned = absolute_trajectory_error(ours.found, ours.true, by)
    views = _Views(found, ours, truth, true_surface)
    lost = sum(bool(row.lost) for row in found.rows)
    focal = focal_error(found.solution.projector.focal, truth.projector.focal)
    return SequenceMetrics(
        frames=len(found.rows),
        lost=lost,
        other_parts=len(found.rows) - lost - len(rows),
        ate_aligned_rms_mm=_rms(aligned),
        ate_aligned_max_mm=float(aligned.max()),
        ate_first_rms_mm=ours.first_error() if in_mm else None,
        **ours.motions(by.scale),
        scale_error_percent=ours.scale_error() if in_mm else None,
        focal_error_percent=focal.value,
        camera_intervals_percent=ours.held("camera") if in_mm else None,
        projector_intervals_percent=ours.held("projector") if in_mm else None,
        **views.surface(),
        depth=views.depth(),
    )  # fmt: skip


class _Pair:
    """Poses found and true, either in the world of the first placed camera."""

    def __init__(
        self, rows: Sequence[FrameRow], true: list[tuple[RigidTransform, RigidTransform]]
    ) -> None:
        self.rows = rows
        cameras = [row.world_from_camera for row in rows if row.world_from_camera is not None]
        self.base = cameras[0].inverse()
        """first_from_world, found."""
        self.true_base = true[0][0].inverse()
        self.found = [self.base @ pose for pose in cameras]
        self.true = [self.true_base @ pose for pose, _ in true]
        self.true_projector = [pose for _, pose in true]

    def first_error(self) -> float:
        by = Similarity.identity()
        return _rms(absolute_trajectory_error(self.found, self.true, by))

    def motions(self, scale: float) -> dict[str, Any]:
        """Return errors of motions over some frames, and from the first frame to the last."""
        scaled = [RigidTransform(pose.R, scale * pose.t) for pose in self.found]
        apart = min(APART, len(scaled) - 1)
        shift, turn = relative_pose_error(scaled, self.true, apart)
        end, _ = relative_pose_error(scaled, self.true, len(scaled) - 1)
        return {
            "rpe_shift_rms_mm": _rms(shift),
            "rpe_turn_rms_deg": float(np.degrees(_rms(turn))),
            "last_to_first_mm": float(end[0]),
        }

    def scale_error(self) -> float:
        by = trajectory_alignment(self.found, self.true, "similarity")
        return 100 * (1 / by.scale - 1)

    def held(self, what: str) -> float | None:
        """Return the share of the 95 % intervals of poses' components that hold the truth, %."""
        inside = []
        for k, row in enumerate(self.rows):
            pose, std = row.world_from_camera, row.camera_std
            true = self.base.inverse() @ self.true[k]
            if what == "projector":
                pose, std, true = (
                    row.projector_from_camera,
                    row.projector_std,
                    self.true_projector[k],
                )
            if std is None or pose is None:
                continue
            turned = Rotation.from_matrix(pose.R @ true.R.T).as_rotvec()
            inside.append(np.abs(np.concatenate([turned, pose.t - true.t])) < INTERVAL * std)
        return 100 * float(np.mean(inside)) if inside else None


class _Views:
    """What frames see of the true surface, and of the one that was found."""

    def __init__(
        self, tracked: TrackedFrames, pair: _Pair, truth: Solution,
        true_surface: SurfaceEstimate | None,
    ) -> None:  # fmt: skip
        self._pair, self._truth = pair, truth
        self._surface, self._true = tracked.surface, true_surface
        self._in_mm = tracked.solution.units == "mm"
        step = -(-len(pair.rows) // SAMPLED)
        self._chosen = range(0, len(pair.rows), step)
        self._views: dict[int, tuple[Floats, Floats]] = {}

    def surface(self) -> dict[str, Any]:
        """Return errors of the surface and its completeness."""
        names = ("surface_rms_mm", "surface_median_mm", "completeness_percent")
        if self._surface is None or self._true is None:
            return dict.fromkeys((*names, "surface_first_rms_mm"))
        plain = self._pair.base.apply(self._surface.vertices)
        vertices = self._by.apply(plain)
        rng = np.random.default_rng(0)
        few = rng.choice(len(vertices), min(VERTICES, len(vertices)), replace=False)
        true = self._pair.true_base.apply(self._true.vertices)
        off, first = (distance_to_mesh(v[few], true, self._true.faces) for v in (vertices, plain))
        seen = np.concatenate([self._seen(k, rng) for k in self._chosen])
        near = distance_to_mesh(seen, vertices, self._surface.faces) <= NEAR
        values = (_rms(off), float(np.median(off)), 100 * float(near.mean()))
        return {
            **dict(zip(names, values, strict=True)),
            "surface_first_rms_mm": _rms(first) if self._in_mm else None,
        }

    def depth(self) -> list[FrameDepth]:
        """Return of some frames how the depth of their pixels differs."""
        if self._surface is None or self._true is None:
            return []
        found = RayCaster(self._surface.vertices, self._surface.faces)
        out = []
        for k in self._chosen:
            row, rays = self._pair.rows[k], self._camera.grid_rays.reshape(-1, 3)
            pose = row.world_from_camera
            assert pose is not None
            scale = self._by.scale
            depth = scale * found.range(pose.t, pose.rotate(rays)) * rays[:, 2]
            lit = np.isfinite(self._view(k)[0].reshape(-1, 2)).all(-1)
            off = np.abs(depth - self._view(k)[1].reshape(-1, 3)[:, 2])[lit]
            known = off[np.isfinite(off)]
            out.append(FrameDepth(
                name=row.name,
                median_mm=float(np.median(known)) if len(known) else None,
                covered_percent=100 * len(known) / max(len(off), 1),
            ))  # fmt: skip
        return out

    @cached_property
    def _by(self) -> Similarity:
        """What takes the surface to the true one by the cameras' whole poses.

        Centres on a straight way say nothing of a rotation about it; so points before the cameras,
        as far as the surface, take part.
        """
        assert self._surface is not None
        found = self._pair.base.apply(self._surface.vertices)
        reach = float(np.median(np.linalg.norm(found, axis=1)))
        length = reach if self._in_mm else self._scaled(reach)
        ours = np.concatenate([_marks(pose, reach) for pose in self._pair.found])
        theirs = np.concatenate([_marks(pose, length) for pose in self._pair.true])
        return align(ours, theirs, scale=not self._in_mm)

    def _scaled(self, length: float) -> float:
        by = trajectory_alignment(self._pair.found, self._pair.true, "similarity")
        return by.scale * length

    def _seen(self, k: int, rng: np.random.Generator) -> Floats:
        """Return points (N, 3) of the true surface that a frame saw lit, first camera's frame."""
        q, points = self._view(k)
        lit = points[np.isfinite(q).all(-1)]
        chosen = lit[rng.integers(len(lit), size=POINTS)] if len(lit) else lit
        return self._pair.true[k].apply(chosen)

    def _view(self, k: int) -> tuple[Floats, Floats]:
        if k not in self._views:
            pose = self._pair.true_base.inverse() @ self._pair.true[k]
            projector, size = self._light
            seen = self._scene.view(
                self._camera, pose, projector, self._pair.true_projector[k], size
            )
            self._views[k] = seen.q, seen.points
        return self._views[k]

    @cached_property
    def _camera(self) -> CameraModel:
        assert self._truth.camera is not None
        return self._truth.camera.to_model()

    @cached_property
    def _light(self) -> tuple[ProjectorModel, tuple[int, int]]:
        projector = self._truth.projector
        model = projector.to_model()
        assert model is not None
        assert projector.width is not None
        assert projector.height is not None
        return model, (projector.width, projector.height)

    @cached_property
    def _scene(self) -> "MeshScene":
        from .. import backend

        backend.ensure()
        from ..rendering.synthetic import MeshScene

        assert self._true is not None
        return MeshScene(self._true.vertices, self._true.faces)


def _true_poses(
    rows: Sequence[FrameRow], truth: Solution
) -> list[tuple[RigidTransform, RigidTransform]]:
    """Return world_from_camera and projector_from_camera of each row's frame in the truth.

    Raises:
        InputError: the truth has no such frame, or not its poses.
    """
    there = {Path(frame.name).stem: frame for frame in truth.frames}
    out = []
    for row in rows:
        frame = there.get(Path(row.name).stem)
        camera = frame and frame.world_from_camera.to_transform()
        projector = frame and frame.projector_from_camera.to_transform()
        if camera is None or projector is None:
            raise InputError(
                f"has no poses of the frame {row.name}", "truth",
                "give the truth of the same sequence, with all of its frames",
            )  # fmt: skip
        out.append((camera, projector))
    return out


def _marks(pose: RigidTransform, reach: float) -> Floats:
    """Return a camera's centre and points (4, 3) before and beside it."""
    return pose.apply(reach * np.vstack([np.zeros(3), np.eye(3)]))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
