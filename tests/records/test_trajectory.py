"""Trajectory files."""

import csv
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.trajectory import FrameRow, load_frames, load_tum, save_frames, save_tum

POSE = RigidTransform.of([0.0, 0.0, np.pi / 2], [1.0, -2.0, 3.5])


def test_tum_line_is_position_and_quaternion(tmp_path: Path) -> None:
    """Oracle: a quarter turn about z is (0, 0, sin 45, cos 45)."""
    save_tum(tmp_path / "a.tum", [(7.0, POSE)])
    numbers = [float(x) for x in (tmp_path / "a.tum").read_text().split()]
    assert numbers == pytest.approx([7, 1, -2, 3.5, 0, 0, np.sqrt(0.5), np.sqrt(0.5)])


def test_tum_files_read_back(tmp_path: Path) -> None:
    save_tum(tmp_path / "a.tum", [(0.0, RigidTransform.identity()), (2.0, POSE)])
    text = "# a comment\n\n" + (tmp_path / "a.tum").read_text()
    (tmp_path / "b.tum").write_text(text)
    (first, _), (second, pose) = load_tum(tmp_path / "b.tum")
    assert (first, second) == (0.0, 2.0)
    assert pose.matrix() == pytest.approx(POSE.matrix())


@pytest.mark.parametrize(
    "line", ["1 2 3", "a b c d e f g h", "0 1 2 3 0 0 0 0", "0 1 2 3 0 0 0 nan"]
)
def test_other_lines_are_refused(line: str, tmp_path: Path) -> None:
    (tmp_path / "a.tum").write_text(f"0 0 0 0 0 0 0 1\n{line}\n")
    with pytest.raises(InputError, match="line 2: is not 't x y z qx qy qz qw'"):
        load_tum(tmp_path / "a.tum")


def test_table_has_a_line_a_frame(tmp_path: Path) -> None:
    std = np.arange(1.0, 7.0)
    rows = [
        FrameRow(0, "a", world_from_camera=POSE, projector_from_camera=POSE, camera_std=std,
                 keyframe=True, overlap=0.5),
        FrameRow(1, "b", lost="it is dark, and moved"),
    ]  # fmt: skip
    save_frames(tmp_path / "frames.csv", rows)
    with (tmp_path / "frames.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert first["camera_z"] == "3.5"
    assert first["camera_std_turn_y"] == "2"
    assert first["camera_std_z"] == "6"
    assert first["projector_std_x"] == ""
    assert (first["keyframe"], first["overlap"], first["misfit"]) == ("1", "0.5", "")
    assert (second["lost"], second["camera_x"]) == ("it is dark, and moved", "")
    assert rows[1].world_from_projector is None
    at = rows[0].world_from_projector
    assert at is not None
    assert at.matrix() == pytest.approx(np.eye(4))


def test_table_reads_back(tmp_path: Path) -> None:
    """Oracle: the rows that were written; other tables are refused."""
    std = np.arange(1.0, 7.0)
    rows = [
        FrameRow(0, "a, b", world_from_camera=POSE, projector_from_camera=POSE, camera_std=std,
                 projector_std=2 * std, keyframe=True, part=1, misfit=1.25, seconds=0.5),
        FrameRow(1, "c", lost='it is "dark", and moved'),
    ]  # fmt: skip
    path = tmp_path / "frames.csv"
    save_frames(path, rows)
    a, b = load_frames(path)
    assert (a.number, a.name, a.lost, a.part, a.keyframe) == (0, "a, b", "", 1, True)
    assert a.world_from_camera is not None
    assert a.world_from_camera.matrix() == pytest.approx(POSE.matrix(), abs=1e-8)
    assert a.projector_std == pytest.approx(2 * std)
    assert (a.misfit, a.overlap, a.seconds) == (1.25, None, 0.5)
    assert (b.lost, b.world_from_camera, b.camera_std) == ('it is "dark", and moved', None, None)
    text = path.read_text()
    long = "x" * 200_000  # of a field more than the csv module takes
    wrongs = ("", "a,b\n1,2\n", text.replace("1.25", "much"), text.replace("1.25", "inf"),
              text + "1,2,3\n")  # fmt: skip
    for wrong in (*wrongs, text + long, long + text):
        path.write_text(wrong)
        with pytest.raises(InputError, match="is no table of frames"):
            load_frames(path)
