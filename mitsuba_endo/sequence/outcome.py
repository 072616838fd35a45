"""What a sequence leads to: the surface of each part, and a solution that shows keyframes."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..fusion import FusedMesh, Volume, surface_of
from ..geometry.transforms import RigidTransform
from ..records.calibration import Calibration, FrameMaps, SurfaceEstimate
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from ..records.solution import Estimate, Frame, LeftOut, Outcome, PoseEstimate, Solution
from ..records.trajectory import FrameRow
from ..robust import robust_std
from ..solve.reporting.assemble import versions
from .adjustment.refusion import FinishedPart, with_deviations
from .bootstrap import Beginning
from .finish import Finished, finish
from .frames import PicturedMap
from .run import Recorded
from .verdict import focal_warning, told

FAR = 4.0
"""Robust standard deviations beyond which a correspondence of a keyframe counts as not used."""


@dataclass(frozen=True, eq=False)
class SequenceResult:
    """Poses of all frames, and surfaces; the unit of length is :attr:`units`."""

    rig: Rig
    rows: list[FrameRow]
    """One a frame, in order."""
    surfaces: list[FusedMesh | None]
    """Of each part, in the frame of the part's first camera; None where nothing hangs together."""
    main: int
    """The part with the most frames."""
    solution: Solution
    """In its world; its frames are a few keyframes, and lost frames are left out."""
    keyframes: Calibration | None
    """The same with surface and maps; None without a surface."""
    pictures: dict[int, NDArray[np.uint8]] = field(default_factory=dict)
    """(H, W, 3) RGB of some keyframes, by their numbers, where images were given."""

    @property
    def units(self) -> Literal["mm", "baseline"]:
        return self.solution.units

    @property
    def lost(self) -> list[FrameRow]:
        """Frames without a pose."""
        return [row for row in self.rows if row.lost]

    def of_part(self, part: int) -> list[FrameRow]:
        """Return the placed frames of a part."""
        return [row for row in self.rows if row.part == part and not row.lost]


def outcome_of(recorded: Recorded, vertices: int | None = 100_000) -> SequenceResult:
    """Make surfaces and a solution of what was recorded.

    Args:
        recorded: of a sequence that ended, or of as much as there is of it.
        vertices: about how many each surface keeps. None: as fine as the voxels.
    """
    beginning = recorded.beginning
    if beginning is None:
        raise ValueError("nothing was recorded before the first frames were calibrated")
    finished = finish(recorded)
    surfaces = [
        _surface(part, tracked.volume, vertices)
        for part, tracked in zip(finished.parts, finished.joined, strict=True)
    ]
    solution = _solution(recorded, beginning, finished)
    surface = surfaces[finished.main]
    keyframes = None
    if surface is not None:
        maps = dict(finished.joined[finished.main].maps)
        keyframes = _calibration(solution, finished.rows, recorded.rig, surface, maps)
        solution = keyframes.solution
    return SequenceResult(
        recorded.rig,
        finished.rows,
        surfaces,
        finished.main,
        solution,
        keyframes,
        _pictures(recorded),
    )


def _pictures(recorded: Recorded) -> dict[int, NDArray[np.uint8]]:
    kept = [pair for maps in recorded.kept for pair in maps.kept]
    pictured = {k: map_.picture for k, map_ in kept if isinstance(map_, PicturedMap)}
    return {k: picture for k, picture in pictured.items() if picture is not None}


def _surface(part: FinishedPart | None, tracked: Volume, vertices: int | None) -> FusedMesh | None:
    try:
        mesh = surface_of(tracked if part is None else part.volume, vertices=vertices)
    except ValueError:  # no two pixels beside each other
        return None
    return mesh if part is None else with_deviations(mesh, part.adjusted)


def _solution(recorded: Recorded, beginning: Beginning, finished: Finished) -> Solution:
    alone, rows = beginning.solution, finished.rows
    shown = {number for number, _ in finished.joined[finished.main].maps}
    lost = [LeftOut(name=row.name, reason=row.lost) for row in rows if row.lost]
    projector = alone.projector.model_copy(update={"focal": _focal(beginning, finished)})
    noise = [row.noise_px for row in rows if row.noise_px is not None]
    return alone.model_copy(update={
        "outcome": Outcome.INTERRUPTED if recorded.interrupted else Outcome.CONVERGED,
        "camera": recorded.rig.camera,
        "projector": projector,
        "frames": [_frame(row) for row in rows if row.number in shown],
        "left_out": lost,
        "alternatives": [],
        "verdict": told(rows, [p is not None for p in finished.parts], projector.focal),
        "warnings": [*recorded.findings.values(), *focal_warning(beginning.told, recorded.told)],
        "noise_px": float(np.median(noise)) if noise else alone.noise_px,
        "model": {},
        "observability": {},
        "timings": {**recorded.seconds, "frames": sum(row.seconds or 0.0 for row in rows)},
        "versions": versions(),
        "configuration": {"rig": recorded.rig.model_dump(mode="json")},
    })  # fmt: skip


def _focal(beginning: Beginning, finished: Finished) -> Estimate:
    alone, value = beginning.solution.projector.focal, float(finished.projector.focal)
    if alone.status == "fixed":
        return alone
    main = finished.parts[finished.main]
    std = value * (beginning.told.std if main is None else main.adjusted.covariance.focal_std)
    if not np.isfinite(std):
        return alone.model_copy(update={"value": value})
    return Estimate(value=value, std=std, std_jackknife=std, status="measured")


def _frame(row: FrameRow) -> Frame:
    assert row.world_from_camera is not None
    assert row.projector_from_camera is not None
    return Frame(
        name=row.name,
        projector_from_camera=_pose(row.projector_from_camera, row.projector_std),
        world_from_camera=_pose(row.world_from_camera, row.camera_std),
    )


def _pose(pose: RigidTransform, std: NDArray[np.float64] | None) -> PoseEstimate:
    if std is None:
        return PoseEstimate.of(pose)
    return PoseEstimate.of(pose, std=std.tolist())


def _calibration(
    solution: Solution, rows: list[FrameRow], rig: Rig, fused: FusedMesh,
    maps: dict[int, CorrespondenceMap],
) -> Calibration:  # fmt: skip
    """Render the keyframes from the surface, beside what was observed."""
    from ..rendering.synthetic import MeshScene

    surface = SurfaceEstimate(fused.vertices, fused.faces, fused.std)
    camera, model = rig.camera.to_model(), solution.projector.to_model()
    assert model is not None
    scene = MeshScene(fused.vertices, fused.faces)
    size = rig.projector.width, rig.projector.height
    shown: list[FrameMaps] = []
    for row in (rows[number] for number in maps):
        assert row.world_from_camera is not None
        assert row.projector_from_camera is not None
        view = scene.view(camera, row.world_from_camera, model, row.projector_from_camera, size)
        shown.append(_maps(maps[row.number], view.q.astype(np.float32)))
    frames = [_with_fit(f, m) for f, m in zip(solution.frames, shown, strict=True)]
    return Calibration(solution.model_copy(update={"frames": frames}), camera, surface, shown)


def _maps(observed: CorrespondenceMap, rendered: NDArray[np.float32]) -> FrameMaps:
    with np.errstate(invalid="ignore"):
        off = np.linalg.norm(observed.q - rendered, axis=-1)
        finite = off[np.isfinite(off)]
        limit = FAR * robust_std(finite) if len(finite) else 0.0
        return FrameMaps(observed.name, observed.q, rendered, off <= limit)


def _with_fit(frame: Frame, maps: FrameMaps) -> Frame:
    squared = (maps.residual.astype(float) ** 2).sum(-1)
    valid, used = np.isfinite(maps.observed).all(-1), maps.used
    return frame.model_copy(update={
        "rms_px": float(np.sqrt(squared[used].mean())) if used.any() else None,
        "median_px": float(np.sqrt(np.nanmedian(squared))) if used.any() else None,
        "used": int(used.sum()),
        "outliers": 1 - float(used.sum()) / max(int(valid.sum()), 1),
    })  # fmt: skip
