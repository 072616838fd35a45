"""The command ``sequence``: what it writes, what it says, what it refuses."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from mitsuba_endo.png import write_png
from mitsuba_endo.records.correspondence import write_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.records.solution import load_solution
from mitsuba_endo.records.surface import load_surface
from mitsuba_endo.records.trajectory import load_tum
from tests.cli.inputs import run
from tests.sequences import Recording, withdrawal

COUNT = 9
DARK = 5
"""A frame whose map holds nothing."""


def _write(folder: Path, recording: Recording, count: int, dark: int | None = None) -> None:
    (folder / "maps").mkdir()
    for k in range(count):
        map_ = recording.map(k)
        if k == dark:
            map_.q[:] = np.nan
        write_map(folder / "maps" / f"{map_.name}.npz", map_)
    data = recording.rig().model_dump(mode="json")
    (folder / "rig.yaml").write_text(yaml.safe_dump(data), encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Maps of a withdrawal, and the folder that the command makes of them."""
    folder = tmp_path_factory.mktemp("sequence")
    _write(folder, withdrawal(COUNT), COUNT, DARK)
    done = run("sequence", folder / "maps", "--rig", folder / "rig.yaml", "--out",
               folder / "out", "--json")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    (folder / "said.json").write_text(done.stdout)
    (folder / "lines.txt").write_text(done.stderr)
    return folder


def test_one_line_a_frame_and_one_summary(folder: Path) -> None:
    """Oracle: the maps written."""
    lines = (folder / "lines.txt").read_text().splitlines()
    assert lines[0] == "frame 1 of 9 (frame0000.npz): begins a map"
    assert lines[DARK] == "frame 6 of 9 (frame0005.npz): lost, the map has no finite value"
    assert lines[DARK + 1].startswith("frame 7 of 9 (frame0006.npz): ")
    assert lines[DARK + 1].endswith(" % known before")
    said = json.loads((folder / "said.json").read_text())
    assert said["frames"] == COUNT
    assert said["lost"] == [{"name": "frame0005.npz", "reason": "the map has no finite value"}]
    assert said["parts"] == 1
    assert said["solution"]["outcome"] == "converged"


def test_files_tell_of_the_same_frames(folder: Path) -> None:
    out = folder / "out"
    with (out / "frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["lost"] != "" for row in rows] == [k == DARK for k in range(COUNT)]
    camera, projector = (load_tum(out / f"trajectory_{w}.tum") for w in ("camera", "projector"))
    assert [time for time, _ in camera] == [k for k in range(COUNT) if k != DARK]
    for (time, pose), (_, light) in zip(camera, projector, strict=True):
        assert pose.t[2] == pytest.approx(float(rows[int(time)]["camera_z"]))
        assert 5 < np.linalg.norm(light.t - pose.t) < 6  # the baseline, mm
    mesh = load_surface(out / "mesh.ply")
    assert len(mesh.vertices) > 5000
    assert mesh.std is not None
    assert 0.01 < np.nanmedian(mesh.std) < 1.0  # mm
    assert b"property float frames_0" in (out / "mesh.ply").read_bytes()[:500]
    solution = load_solution(out)
    assert solution.surface == "mesh.ply"
    assert [frame.name for frame in solution.left_out] == ["frame0005.npz"]


def test_keyframes_are_a_solution_folder(folder: Path) -> None:
    """Oracle: the other commands read it."""
    keyframes = folder / "out" / "keyframes"
    assert (keyframes / "report.html").is_file()
    assert run("report", keyframes, "--out", folder / "report.html").exit_code == 0
    assert run("export", keyframes, "--format", "ply", "--out", folder / "a.ply").exit_code == 0
    copy = shutil.copytree(keyframes, folder / "copy")  # a result is not taken as its own truth
    same = run("evaluate", keyframes, "--truth", copy, "--out", folder / "metrics.json")
    assert same.exit_code == 0, same.stderr
    assert json.loads((folder / "metrics.json").read_text())["focal_error_percent"] == 0


def test_report_of_the_folder_draws_all_frames(folder: Path) -> None:
    """Oracle: the frames that were tracked; the page is of the keyframes besides."""
    done = run("report", folder / "out", "--out", folder / "all.html")
    assert done.exit_code == 0, done.stderr
    page = (folder / "all.html").read_text(encoding="utf-8")
    assert f"All {COUNT} frames" in page
    assert "5, frame0005.npz: the map has no finite value" in page
    assert 'alt="poses over the frames"' in page
    assert "grey frames lost (1)" in page
    alone = run("report", folder / "out" / "keyframes", "--out", folder / "some.html")
    assert alone.exit_code == 0
    assert "poses over the frames" not in (folder / "some.html").read_text(encoding="utf-8")


def test_start_end_and_stride_choose_frames(folder: Path) -> None:
    done = run("sequence", folder / "maps", "--rig", folder / "rig.yaml", "--out",
               folder / "some", "--start", 1, "--end", 8, "--stride", 2, "--json",
               "--save", "depth, points")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["frames"] == 4  # 1, 3, 5, 7
    assert [frame["name"] for frame in said["lost"]] == ["frame0005.npz"]
    names = [f"{i:05d}_frame{k:04d}" for i, k in enumerate((1, 3, 5, 7)) if k != DARK]
    for kind, suffix in (("depth", ".exr"), ("points", ".ply")):
        files = sorted((folder / "some" / kind).iterdir())
        assert [file.name for file in files] == [name + suffix for name in names]


def test_maps_of_another_tool_under_a_mask(folder: Path) -> None:
    """Oracle: the poses from the same maps as they are counted here, without the tool's pixels."""
    recording = withdrawal(COUNT)
    for name in ("theirs", "ours"):
        (folder / name).mkdir()
    mask = np.full(recording.map(0).valid.shape, 255, np.uint8)
    mask[80:, 120:] = 0
    write_png(folder / "tool.png", mask)
    for k in range(COUNT):
        q = recording.map(k).q
        np.save(folder / "theirs" / f"{k}.npy", q + np.float32(1))
        np.save(folder / "ours" / f"{k}.npy", np.where(mask[..., None] > 0, q, np.float32(np.nan)))
    options = {"theirs": ("--map-convention", "one-based", "--mask", folder / "tool.png"),
               "ours": ()}  # fmt: skip
    ways = []
    for name, given in options.items():
        done = run("sequence", folder / name, "--rig", folder / "rig.yaml", "--out",
                   folder / f"of_{name}", *given)  # fmt: skip
        assert done.exit_code == 0, done.stderr
        ways.append(load_tum(folder / f"of_{name}" / "trajectory_camera.tum"))
    for (_, theirs), (_, ours) in zip(*ways, strict=True):
        np.testing.assert_allclose(theirs.t, ours.t, atol=2e-3)  # of counting in single precision
    line = _refused(folder, folder / "theirs", "--resume", folder / "of_theirs")
    assert "was with map_convention one-based, not" in line


def test_depth_files_hold_the_scenes_depth(folder: Path) -> None:
    """Oracle: the scene; half a millimetre is the noise of some pixels that a voxel averages."""
    recording = withdrawal(COUNT)
    depth = read_exr(folder / "some" / "depth" / "00003_frame0007.exr")["Z"]
    off = depth - recording.exact(7)[1][..., 2]
    assert np.isfinite(off).mean() > 0.5
    assert np.nanmedian(np.abs(off)) < 0.5


def test_unknown_files_are_refused(folder: Path) -> None:
    line = _refused(folder, folder / "maps", "--save", "depth,masks")
    assert "--save: 'masks' is unknown; choose from depth, points" in line


def test_interrupt_leaves_a_usable_result(tmp_path: Path) -> None:
    """Oracle: the listing after SIGINT in the middle of the way."""
    _write(tmp_path, withdrawal(60), 40)
    command = [sys.executable, "-m", "mitsuba_endo", "sequence", "maps", "--rig", "rig.yaml",
               "--out", "out"]  # fmt: skip
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("frame 24 of"):
            process.send_signal(signal.SIGINT)
            break
    said, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "frames were placed" in said
    assert load_solution(tmp_path / "out").outcome == "interrupted"
    with (tmp_path / "out" / "frames.csv").open(newline="") as file:
        assert 20 <= len(list(csv.DictReader(file))) < 40
    assert sorted(p.name for p in tmp_path.iterdir()) == ["maps", "out", "rig.yaml"]


def test_live_shows_it_and_ends_with_it(folder: Path) -> None:
    """Oracle: exit code 0 without a terminal to press Ctrl-C in, and the viewer's address."""
    pytest.importorskip("viser")
    command = [sys.executable, "-m", "mitsuba_endo", "sequence", "maps", "--rig", "rig.yaml",
               "--out", "live", "--end", "4", "--live"]  # fmt: skip
    environment = {"PYTHONPATH": str(Path(__file__).parents[2]), "BROWSER": "true"}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, check=False, timeout=300,
        stdin=subprocess.DEVNULL, env=os.environ | environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "the viewer; it ends with Ctrl-C." in done.stdout
    assert "4 of 4 frames were placed." in done.stdout


def _refused(folder: Path, *arguments: object) -> str:
    """Return the one sentence with which the command refuses, and see that it left nothing."""
    out = folder / "refused"
    done = run("sequence", *arguments, "--rig", folder / "rig.yaml", "--out", out)
    assert done.exit_code in (2, 3), done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    assert not out.exists()
    return line


def test_one_frame_is_refused(folder: Path) -> None:
    line = _refused(folder, folder / "maps" / "frame0000.npz")
    assert "one frame is no sequence; use the command calibrate" in line


def test_no_frame_left_is_refused(folder: Path) -> None:
    assert "of 9 frames none is left" in _refused(folder, folder / "maps", "--start", 9)


def test_maps_with_options_for_images_are_refused(folder: Path) -> None:
    line = _refused(folder, folder / "maps", "--pattern", "pattern:coded")
    assert "--pattern: is for images, and maps are given" in line
    assert "--no-refine" in _refused(folder, folder / "maps", "--no-refine")


def test_other_files_are_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("a")
    assert "unknown kind of file '.txt'" in _refused(folder, tmp_path / "a.txt")
    assert "holds no image" in _refused(folder, tmp_path)


def test_images_of_changing_size_are_refused(folder: Path, tmp_path: Path) -> None:
    """The first has the rig's size and shows nothing, the second has another size."""
    write_png(tmp_path / "a0.png", np.zeros((120, 160, 3), np.uint8))
    write_png(tmp_path / "a1.png", np.zeros((90, 160, 3), np.uint8))
    line = _refused(folder, tmp_path)
    assert "a1.png: is 160 x 90 pixels" in line
    assert "give the rig of the camera that took it" in line


def test_images_without_the_pattern_are_refused(folder: Path, tmp_path: Path) -> None:
    for k in range(2):
        write_png(tmp_path / f"a{k}.png", np.zeros((120, 160, 3), np.uint8))
    line = _refused(folder, tmp_path)
    assert "no frame shows enough of the pattern" in line
    assert "the image is dark" in line


def test_a_rig_of_another_pattern_is_refused(folder: Path) -> None:
    data = yaml.safe_load((folder / "rig.yaml").read_text())
    data["projector"] |= {"width": 60, "height": 50, "centre": None}
    other = folder / "other.yaml"
    other.write_text(yaml.safe_dump(data), encoding="utf-8")
    done = run("sequence", folder / "maps", "--rig", other, "--out", folder / "refused")
    assert done.exit_code == 2
    assert "projector.width" in done.stderr
    assert not (folder / "refused").exists()
