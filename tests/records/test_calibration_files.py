"""Calibrations of OpenCV and COLMAP read as solutions: the numbers that were written."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.errors import evaluate
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.calibration_files import read_calibration
from mitsuba_endo.records.solution import Estimate, Solution
from mitsuba_endo.show.exports import export
from mitsuba_endo.show.solution_folder import write_solution_folder
from tests.show.conftest import make_calibration  # noqa: F401  (a fixture)

Maker = Callable[..., Calibration]


@pytest.fixture(scope="module")
def result(
    tmp_path_factory: pytest.TempPathFactory,
    make_calibration: Maker,  # noqa: F811
) -> tuple[Path, Solution]:
    """Two frames with a pinhole projector, written."""
    made = make_calibration(width=64, height=46, count=2)
    projector = made.solution.projector.model_copy(
        update={"law": "pinhole", "distortion": Estimate(value=[0.04, -0.01], status="fixed")}
    )
    solution = made.solution.model_copy(update={"projector": projector})
    folder = tmp_path_factory.mktemp("calibrations") / "result"
    write_solution_folder(folder, replace(made, solution=solution))
    return folder, solution


def _worst(found: Solution, true: Solution) -> float:
    """Return the largest error of a value, whatever its unit."""
    metrics = evaluate(found, true)
    assert metrics.matched_by == "name"
    errors = [v.error for v in metrics.values]
    assert len(errors) >= 30
    assert None not in errors
    return max(abs(e) for e in errors if e is not None)


def test_opencv_s_file_is_the_solution(result: tuple[Path, Solution], tmp_path: Path):
    """Oracle: the solution that was exported; every suffix of FileStorage."""
    folder, solution = result
    for suffix in ("yml", "xml", "json"):
        path = tmp_path / f"camera.{suffix}"
        export(folder, "opencv", path)
        found, name = read_calibration(path)
        assert name == "an OpenCV file of camera and projector"
        assert found.units == "mm"
        assert _worst(found, solution) < 1e-9


@pytest.mark.parametrize("binary", [False, True])
def test_colmap_s_model_is_the_solution_up_to_scale(
    result: tuple[Path, Solution], tmp_path: Path, binary: bool
):
    """Oracle: the solution that was exported, lengths over its first baseline; binary files are
    written by COLMAP itself."""
    folder, solution = result
    path = tmp_path / "model"
    export(folder, "colmap", path)
    if binary:
        pycolmap = pytest.importorskip("pycolmap")
        model = pycolmap.Reconstruction(str(path))
        path = tmp_path / "binary"
        path.mkdir()
        model.write_binary(str(path))
    found, _ = read_calibration(path)
    assert found.units == "baseline"
    assert [f.name for f in found.frames] == ["run/frame_0.exr", "run/frame_1.exr"]
    assert _worst(found, solution) < 1e-6


def test_another_program_s_stereo_file(tmp_path: Path):
    """Oracle: numbers written by hand, as Moreno and Taubin's program names them."""
    pose = RigidTransform.of([0.1, -0.2, 0.05], [-6.0, 1.4, 0.5])
    path = tmp_path / "calibration.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (
        ("cam_K", np.array([[500.0, 0, 320], [0, 505, 241], [0, 0, 1]])),
        ("cam_kc", np.array([[-0.1, 0.02, 0, 0, 0]])),
        ("proj_K", np.array([[900.0, 0, 510], [0, 918, 390], [0, 0, 1]])),
        ("proj_kc", np.array([[0.05, 0, 0, 0, 0]])),
        ("R", pose.R), ("T", pose.t.reshape(3, 1)),
    ):  # fmt: skip
        storage.write(name, value)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.release()
    found, _ = read_calibration(path)
    assert found.projector.focal.value == 900
    assert found.projector.aspect.value == pytest.approx(1.02)
    assert found.projector.distortion.value == [0.05]
    placed = found.frames[0].projector_from_camera.to_transform()
    assert placed is not None
    np.testing.assert_allclose(placed.matrix(), pose.matrix(), atol=1e-12)


def test_what_is_no_calibration_is_refused(result: tuple[Path, Solution], tmp_path: Path):
    """Oracle: what is missing, by name."""
    folder, _ = result
    (tmp_path / "camera.yml").write_text(
        "image_width: 64\nimage_height: 46\ncamera_matrix: [[50, 0, 30], [0, 50, 20], [0, 0, 1]]\n"
    )
    with pytest.raises(InputError, match="holds a camera and no projector"):
        read_calibration(tmp_path / "camera.yml")
    model = tmp_path / "model"
    export(folder, "colmap", model)
    text = (model / "images.txt").read_text()
    (model / "images.txt").write_text(text.replace("projector/", "other/"))
    with pytest.raises(InputError, match="no image is called projector/NAME"):
        read_calibration(model)
    (model / "images.txt").write_text("1 0 0\n\n")
    with pytest.raises(InputError, match="is no list of images"):
        read_calibration(model)
    (model / "cameras.bin").write_bytes(b"\x05\0\0\0")
    (model / "images.bin").write_bytes(b"")
    with pytest.raises(InputError, match="ends too early"):
        read_calibration(model)
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="holds no calibration; give one of an OpenCV file"):
        read_calibration(tmp_path / "folder")
    with pytest.raises(InputError, match="no such file"):
        read_calibration(tmp_path / "absent.json")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (r"projector_width: \d+", "projector_width: {}", "width: input should be a valid integer"),
        ("projector_law: pinhole", "projector_law: nothing", "law: "),
    ],
)
def test_values_that_make_no_projector_are_refused(
    result: tuple[Path, Solution], tmp_path: Path, old: str, new: str, words: str
):
    path = tmp_path / "camera.yml"
    export(result[0], "opencv", path)
    text = re.sub(old, new, path.read_text())
    assert new in text
    path.write_text(text)
    with pytest.raises(InputError, match=re.escape(words)):
        read_calibration(path)


def test_infinite_numbers_of_a_model_are_refused(result: tuple[Path, Solution], tmp_path: Path):
    export(result[0], "colmap", tmp_path / "model")
    path = tmp_path / "model" / "cameras.txt"
    lines = path.read_text().splitlines()
    last = next(k for k in reversed(range(len(lines))) if not lines[k].startswith("#"))
    parts = lines[last].split()
    lines[last] = " ".join([*parts[:4], "1e400", *parts[5:]])
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"input should be a finite number, got inf"):
        read_calibration(tmp_path / "model")
