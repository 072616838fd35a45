"""``render --trajectory``: maps with truth that the commands sequence and evaluate take."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.solution import load_solution
from mitsuba_endo.records.trajectory import load_tum, save_tum
from mitsuba_endo.rendering.scene import load_scene
from mitsuba_endo.rendering.synthetic import MeshScene
from tests.cli.inputs import run

SMALL = [
    word
    for setting in (
        "width=160", "height=120", "fx=105", "cx=80.2", "cy=58.7",
        "surface=shape:colon?behind=60&radius=22&length=60&bend=0.3&fold_depth=6&edge=1.5",
    )
    for word in ("--set", setting)
]  # fmt: skip
COUNT = 24


def _render(out: Path, *options: object, scene: str = "colon"):
    return run("render", scene, "--out", out, *SMALL, "--trajectory", *options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording")
    done = _render(folder / "way", "withdrawal", "--frames", COUNT, "--noise", 0.2, "--nothing",
                   "10:12", "--seed", 3)  # fmt: skip
    assert done.exit_code == 0, done.stderr
    assert f"{COUNT} maps. Track them: mitsuba-endo sequence" in " ".join(done.stdout.split())
    return folder


def test_maps_are_those_of_the_poses(folder: Path) -> None:
    """Oracle: rays through the scene from the trajectories' poses; noise is white, of 0.2 px."""
    way = folder / "way"
    scene = load_scene("colon", **dict(word.split("=", 1) for word in SMALL[1::2]))
    mesh = scene.surface()
    world = scene.world_from_camera()
    camera, projector = (
        dict(load_tum(way / f"trajectory_{what}.tum")) for what in ("camera", "projector")
    )
    assert list(camera) == list(range(COUNT))
    view = MeshScene(mesh.vertices.astype(float), mesh.faces).view(
        scene.camera(), world @ camera[7], scene.projector(), projector[7].inverse() @ camera[7],
        scene.pattern_size(),
    )  # fmt: skip
    found = load_map(way / "maps" / "frame0007.exr").q
    off = (found - view.q)[np.isfinite(view.q).all(-1)]
    assert np.isfinite(off).all()
    assert np.std(off) == pytest.approx(0.2, rel=0.05)
    with pytest.raises(InputError, match="no finite value"):
        load_map(way / "maps" / "frame0010.exr")


def test_camera_withdraws_and_projector_creeps(folder: Path) -> None:
    """Oracle: half a millimetre a frame; the projector stays within its rig's drift."""
    truth = load_solution(folder / "way" / "truth.json")
    assert [frame.name for frame in truth.frames] == [f"frame{k:04d}" for k in range(COUNT)]
    poses = [frame.world_from_camera.to_transform() for frame in truth.frames]
    assert poses[0] is not None
    assert poses[-1] is not None
    assert np.allclose(poses[0].matrix(), np.eye(4))
    assert abs(poses[-1].t[2] + 0.5 * (COUNT - 1)) < 4
    lights = [frame.projector_from_camera.to_transform() for frame in truth.frames]
    steps = [np.linalg.norm(b.t - a.t) for a, b in pairwise(lights) if a and b]
    assert 0.001 < np.median(steps) < 0.05
    rig = yaml.safe_load((folder / "way" / "rig.yaml").read_text())
    assert rig["drift"]["insertion_mm"] == 0.05
    assert "value" not in rig["projector"].get("focal", {})


def test_sequence_takes_the_folder(folder: Path) -> None:
    """Oracle: the truth of the last frame; frames of nothing alone are lost."""
    done = run("sequence", folder / "way" / "maps", "--rig", folder / "way" / "rig.yaml", "--out",
               folder / "result")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    found = dict(load_tum(folder / "result" / "trajectory_camera.tum"))
    true = dict(load_tum(folder / "way" / "trajectory_camera.tum"))
    assert sorted(set(true) - set(found)) == [10, 11]
    assert np.linalg.norm(found[COUNT - 1].t - true[COUNT - 1].t) < 0.5


def test_evaluate_compares_every_frame_with_the_truth(folder: Path) -> None:
    """Oracle: noise of 0.2 px is some 0.1 mm at the wall. Runs on the result of the test above."""
    out = folder / "metrics.json"
    done = run("evaluate", folder / "result", "--truth", folder / "way" / "truth.json", "--out",
               out, "--json")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    found = json.loads(out.read_text())
    assert json.loads(done.stdout) == found
    assert (found["frames"], found["lost"], found["other_parts"]) == (COUNT, 2, 0)
    assert 0 < found["ate_aligned_rms_mm"] < 0.2
    assert 0 < found["surface_rms_mm"] < 0.3
    assert found["completeness_percent"] > 90
    assert "absolute trajectory error, aligned, RMS" in done.stderr
    other = run("evaluate", folder / "result", "--truth", folder / "result" / "keyframes", "--out",
                folder / "other.json")  # fmt: skip
    assert other.exit_code == 2
    assert "has no poses of the frame" in other.stderr


def test_poses_of_files_are_taken(tmp_path: Path, folder: Path) -> None:
    """Oracle: the trajectories that the first rendering wrote give its maps, without noise."""
    way = folder / "way"
    done = _render(tmp_path / "again", way / "trajectory_camera.tum", "--projector-trajectory",
                   way / "trajectory_projector.tum", "--frames", 8)  # fmt: skip
    assert done.exit_code == 0, done.stderr
    a, b = (load_map(f / "maps" / "frame0007.exr").q for f in (way, tmp_path / "again"))
    both = np.isfinite(a).all(-1) & np.isfinite(b).all(-1)
    assert both.sum() > 5000
    assert np.std((a - b)[both]) == pytest.approx(0.2, rel=0.05)


def test_photographs_are_images_of_the_grid(tmp_path: Path) -> None:
    import cv2

    done = _render(tmp_path / "way", "pan", "--frames", 3, "--photographs", "--spp", 4,
                   "--nothing", "1:2")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    images = [cv2.imread(str(tmp_path / "way" / "images" / f"frame{k:04d}.png")) for k in range(3)]
    assert [image.shape for image in images if image is not None] == [(120, 160, 3)] * 3
    means = [float(image.mean()) for image in images if image is not None]
    assert means[1] == 0
    assert min(means[0], means[2]) > 10
    assert not (tmp_path / "way" / "maps").exists()


def test_what_cannot_be_rendered_is_refused(tmp_path: Path) -> None:
    save_tum(tmp_path / "two.tum", [])
    cases = {
        "give a TUM file, or withdrawal, pan": ["nowhere.tum"],
        "two.tum: holds 0 poses": [tmp_path / "two.tum"],
        "'7' is not A:B": ["pan", "--nothing", "7"],
        "--noise: is of maps": ["pan", "--noise", "1", "--photographs"],
    }
    for words, options in cases.items():
        done = _render(tmp_path / "out", *options)
        assert done.exit_code == 2, done.stderr
        assert words in done.stderr
        assert not (tmp_path / "out").exists()
    alone = run("render", "colon", "--out", tmp_path / "out", "--noise", "1")
    assert "--noise: is of a sequence; give --trajectory too" in alone.stderr
    grey = _render(tmp_path / "out", "pan", "--frames", 2, "--photographs", "--set",
                   "pattern=pattern:gray?width=480&height=384&index=0")  # fmt: skip
    assert grey.exit_code == 2, grey.stderr
