"""The surface of a tracked sequence against the true one, as its frames see it."""

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CameraModel
from ..geometry.projection_models import ProjectorModel
from ..geometry.transforms import RigidTransform
from ..records.calibration import SurfaceEstimate
from ..records.solution import INTERVAL, Solution
from .alignment import Similarity, align
from .depth import RayCaster
from .distance import distance_to_mesh
from .metric_value import root_mean_square
from .sequence_metrics import FrameDepth
from .shape import model_and_size
from .tracked_frames import PosePairs, TrackedFrames
from .trajectory_errors import trajectory_alignment

if TYPE_CHECKING:
    from ..rendering.synthetic import MeshScene

Floats = NDArray[np.float64]

NEAR = 1.0
"""mm within which the true surface counts as found."""
SAMPLED = 20
"""Frames, spread over the sequence, whose view of the surface is compared, at most."""
POINTS = 400
"""Of each such frame, by which the true surface that was seen is looked for."""
VERTICES = 20_000
"""Of the surface found that are compared, at most."""


class TrackedViews:
    """What frames see of the true surface, and of the one that was found."""

    def __init__(
        self, tracked: TrackedFrames, pair: PosePairs, truth: Solution,
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
            return dict.fromkeys((*names, "surface_first_rms_mm", "vertex_intervals_percent"))
        plain = self._pair.base.apply(self._surface.vertices)
        vertices = self._by.apply(plain)
        rng = np.random.default_rng(0)
        few = rng.choice(len(vertices), min(VERTICES, len(vertices)), replace=False)
        true = self._pair.true_base.apply(self._true.vertices)
        off, first = (distance_to_mesh(v[few], true, self._true.faces) for v in (vertices, plain))
        visible_points = np.concatenate([self._seen(k, rng) for k in self._chosen])
        near = distance_to_mesh(visible_points, vertices, self._surface.faces) <= NEAR
        values = (root_mean_square(off), float(np.median(off)), 100 * float(near.mean()))
        return {
            **dict(zip(names, values, strict=True)),
            "surface_first_rms_mm": root_mean_square(first) if self._in_mm else None,
            "vertex_intervals_percent": self._held(first, few) if self._in_mm else None,
        }

    def _held(self, off: Floats, vertices: NDArray[np.int64]) -> float | None:
        """Return the share, %, of some vertices' 95 % intervals that hold the true surface."""
        assert self._surface is not None
        if self._surface.std is None:
            return None
        std = self._surface.std[vertices]
        finite = np.isfinite(std)
        return 100 * float((off < INTERVAL * std)[finite].mean()) if finite.any() else None

    def depth(self) -> list[FrameDepth]:
        """Return of some frames how the depth of their pixels differs."""
        if self._surface is None or self._true is None:
            return []
        caster = RayCaster(self._surface.vertices, self._surface.faces)
        out = []
        for k in self._chosen:
            row, rays = self._pair.rows[k], self._camera.grid_rays.reshape(-1, 3)
            pose = row.world_from_camera
            assert pose is not None
            scale = self._by.scale
            depth = scale * caster.range(pose.t, pose.rotate(rays)) * rays[:, 2]
            lit = np.isfinite(self._view(k)[0].reshape(-1, 2)).all(-1)
            off = np.abs(depth - self._view(k)[1].reshape(-1, 3)[:, 2])[lit]
            finite = off[np.isfinite(off)]
            out.append(FrameDepth(
                name=row.name,
                median_mm=float(np.median(finite)) if len(finite) else None,
                covered_percent=100 * len(finite) / max(len(off), 1),
            ))  # fmt: skip
        return out

    @cached_property
    def _by(self) -> Similarity:
        """What takes the surface to the true one by the cameras' whole poses.

        Centres on a straight way say nothing of a rotation about it; so points before the cameras,
        as far as the surface, take part.
        """
        assert self._surface is not None
        vertices = self._pair.base.apply(self._surface.vertices)
        reach = float(np.median(np.linalg.norm(vertices, axis=1)))
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
            view = self._scene.view(
                self._camera, pose, projector, self._pair.true_projector[k], size
            )
            self._views[k] = view.q, view.points
        return self._views[k]

    @cached_property
    def _camera(self) -> CameraModel:
        assert self._truth.camera is not None
        return self._truth.camera.to_model()

    @cached_property
    def _light(self) -> tuple[ProjectorModel, tuple[int, int]]:
        light = model_and_size(self._truth.projector)
        assert light is not None
        return light

    @cached_property
    def _scene(self) -> "MeshScene":
        from .. import backend

        backend.ensure()
        from ..rendering.synthetic import MeshScene

        assert self._true is not None
        return MeshScene(self._true.vertices, self._true.faces)


def _marks(pose: RigidTransform, reach: float) -> Floats:
    """Return a camera's centre and points (4, 3) before and beside it."""
    return pose.apply(reach * np.vstack([np.zeros(3), np.eye(3)]))
