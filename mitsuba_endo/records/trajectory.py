"""Poses of many frames as files: TUM trajectories, and a table with deviations."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..files import atomic_path
from ..geometry.transforms import RigidTransform
from ..reading.regular import TABLE, read_text

_DIGITS = 9
"""Significant ones in files: far below any deviation."""
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_FURTHER = ("noise_px", "misfit", "overlap", "agreement", "rms_px", "coverage", "seconds")
_STEP = ("turn_x", "turn_y", "turn_z", "x", "y", "z")


@dataclass(frozen=True, eq=False)
class FrameRow:
    """What a sequence keeps of a frame."""

    number: int
    """In the order of the input, from 0."""
    name: str
    lost: str = ""
    """Why the frame has no pose, in words; empty if it has one."""
    part: int = 0
    """Parts of a sequence do not overlap; each has a world of its own."""
    keyframe: bool = False
    world_from_camera: RigidTransform | None = None
    projector_from_camera: RigidTransform | None = None
    camera_std: NDArray[np.float64] | None = None
    """(6,) rotation vector (radians) and translation, as a solution's poses have them."""
    projector_std: NDArray[np.float64] | None = None
    """(6,) likewise."""
    noise_px: float | None = None
    """Robust standard deviation of a coordinate across its epipolar line, pattern pixels."""
    misfit: float | None = None
    """Robust standard deviation of the distances to the map over that expected of noise."""
    overlap: float | None = None
    """Share of the correspondences where the map was known before the frame."""
    agreement: float | None = None
    """Share of these within three standard deviations of the map."""
    rms_px: float | None = None
    """Robust RMS of the residuals of the pixels used, pattern pixels."""
    coverage: float | None = None
    """Share of the image's pixels that were used."""
    seconds: float | None = None

    @property
    def world_from_projector(self) -> RigidTransform | None:
        """Where the projector is."""
        if self.world_from_camera is None or self.projector_from_camera is None:
            return None
        return self.world_from_camera @ self.projector_from_camera.inverse()


def save_tum(path: str | Path, poses: Sequence[tuple[float, RigidTransform]]) -> None:
    """Write a trajectory as the RGB-D benchmark of TU Munich has it: t x y z qx qy qz qw.

    Args:
        path: the file.
        poses: times, or numbers of frames, and transforms into the world.

    Raises:
        InputError: the file cannot be written.
    """
    lines = []
    for time, pose in poses:
        numbers = [*pose.t, *Rotation.from_matrix(pose.R).as_quat()]
        lines.append(" ".join([f"{time:.9g}", *(f"{x:.{_DIGITS}g}" for x in numbers)]))
    with atomic_path(path) as aside:
        aside.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def load_tum(path: str | Path) -> list[tuple[float, RigidTransform]]:
    """Read what :func:`save_tum` writes; lines that begin with # are left out.

    Raises:
        InputError: missing file, or a line without eight numbers that make a pose.
    """
    poses = []
    for number, line in enumerate(read_text(path, TABLE).splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        try:
            time, x, y, z, *q = (float(word) for word in line.replace(",", " ").split())
            if len(q) != 4 or not np.isfinite([time, x, y, z, *q]).all():
                raise ValueError
            pose = RigidTransform(Rotation.from_quat(q).as_matrix(), np.array([x, y, z]))
        except ValueError:
            raise InputError(
                "is not 't x y z qx qy qz qw'", f"{path}: line {number}", "mend it"
            ) from None
        poses.append((time, pose))
    return poses


def save_frames(path: str | Path, rows: Sequence[FrameRow]) -> None:
    """Write one line a frame as CSV; an empty field is a value that does not exist.

    Poses are X_world = R X_camera + t and X_projector = R X_camera + t with R as a quaternion.

    Raises:
        InputError: the file cannot be written.
    """
    with atomic_path(path) as aside, aside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(_heads())
        writer.writerows(_cells(row) for row in rows)


def load_frames(path: str | Path) -> list[FrameRow]:
    """Read what :func:`save_frames` writes.

    Raises:
        InputError: missing file, or one that is no such table.
    """
    lines = csv.DictReader(read_text(path, TABLE).splitlines())
    try:
        if lines.fieldnames != _heads():
            raise ValueError
        return [_row(cells) for cells in lines]
    except (TypeError, ValueError, KeyError, csv.Error):
        raise InputError("is no table of frames", str(path), "make it again") from None


def _row(cells: dict[str, str]) -> FrameRow:
    if None in cells or None in cells.values():  # a longer or shorter line
        raise ValueError

    def numbers(prefix: str, names: Sequence[str]) -> NDArray[np.float64] | None:
        texts = [cells[f"{prefix}_{name}"] for name in names]
        return np.array([_finite(text) for text in texts]) if all(texts) else None

    def pose(prefix: str) -> RigidTransform | None:
        values = numbers(prefix, _POSE)
        if values is None:
            return None
        return RigidTransform(Rotation.from_quat(values[3:]).as_matrix(), values[:3])

    further = {name: _finite(cells[name]) if cells[name] else None for name in _FURTHER}
    return FrameRow(
        int(cells["number"]), cells["name"], cells["lost"], int(cells["part"]),
        cells["keyframe"] == "1", pose("camera"), pose("projector"),
        numbers("camera_std", _STEP), numbers("projector_std", _STEP), **further,
    )  # fmt: skip


def _finite(text: str) -> float:
    value = float(text)
    if not np.isfinite(value):  # what does not exist is an empty field
        raise ValueError
    return value


def _heads() -> list[str]:
    return [
        "number", "name", "part", "keyframe", "lost",
        *(f"camera_{p}" for p in _POSE), *(f"camera_std_{s}" for s in _STEP),
        *(f"projector_{p}" for p in _POSE), *(f"projector_std_{s}" for s in _STEP),
        *_FURTHER,
    ]  # fmt: skip


def _cells(row: FrameRow) -> list[str]:
    return [
        str(row.number), row.name, str(row.part), str(int(row.keyframe)), row.lost,
        *_pose(row.world_from_camera), *_numbers(row.camera_std, 6),
        *_pose(row.projector_from_camera), *_numbers(row.projector_std, 6),
        *(_number(x) for x in (row.noise_px, row.misfit, row.overlap, row.agreement)),
        *(_number(x) for x in (row.rms_px, row.coverage)),
        "" if row.seconds is None else f"{row.seconds:.4f}",
    ]  # fmt: skip


def _pose(pose: RigidTransform | None) -> list[str]:
    if pose is None:
        return [""] * 7
    return _numbers(np.concatenate([pose.t, Rotation.from_matrix(pose.R).as_quat()]), 7)


def _numbers(values: NDArray[np.float64] | None, count: int) -> list[str]:
    return [""] * count if values is None else [_number(float(x)) for x in values]


def _number(value: float | None) -> str:
    return "" if value is None or not np.isfinite(value) else f"{value:.{_DIGITS}g}"
