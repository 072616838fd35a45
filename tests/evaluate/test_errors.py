"""Whole evaluations: from two records and folders to metrics.json."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.errors import evaluate
from mitsuba_endo.evaluate.metrics_file import Metrics
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.records.solution import (
    Estimate,
    PoseEstimate,
)
from mitsuba_endo.records.surface import save_surface
from tests.evaluate.records import CAMERA_POSES, record_of, with_focal, with_frame

pytestmark = pytest.mark.usefixtures("llvm")


@pytest.fixture
def folders(tmp_path: Path, world: SimpleNamespace) -> tuple[Path, Path]:
    """A folder with a surface 0.1 mm too far, and one with the true surface."""
    for name, depth in (("solution", 70.1), ("truth", 70.0)):
        (tmp_path / name).mkdir()
        save_surface(tmp_path / name / "surface.ply", world.sheet(depth))
    return tmp_path / "solution", tmp_path / "truth"


def test_truth_against_itself_is_perfect(world: SimpleNamespace, folders: tuple[Path, Path]):
    """Oracle: zero errors, full coverage, no reasons."""
    truth = record_of(world)
    found = evaluate(truth, truth, folders[1], folders[1])
    assert found.focal_error_percent == 0
    assert found.rotation_error_deg == pytest.approx(0, abs=1e-12)
    assert found.translation_direction_error_deg == pytest.approx(0, abs=1e-12)
    assert found.baseline_error_percent == pytest.approx(0, abs=1e-12)
    assert found.shape_rmse_mm == pytest.approx(0, abs=1e-9)
    assert found.shape_ray_rmse_mm == pytest.approx(0, abs=1e-9)
    assert found.coverage == 1
    assert found.alignment == "none"
    assert found.reasons == {}
    assert len(found.frames) == 3


def test_known_errors_come_out(world: SimpleNamespace, folders: tuple[Path, Path]):
    """Oracle: the errors put in: f + 1 %, 0.3 degrees and + 2 % of baseline in frame b of three."""
    solution = with_focal(record_of(world), value=121.2, status="measured")
    pose = world.pose
    turned = RigidTransform.of([np.radians(0.3), 0, 0], [0, 0, 0]).R @ pose.R
    wrong = PoseEstimate.of(RigidTransform(turned, 1.02 * pose.t))
    found = evaluate(
        with_frame(solution, 1, projector_from_camera=wrong), record_of(world), *folders
    )
    assert found.focal_error_percent == pytest.approx(1.0)
    assert found.rotation_error_deg == pytest.approx(0.3 / np.sqrt(3), rel=1e-6)
    assert found.baseline_error_percent == pytest.approx(2 / np.sqrt(3))
    assert found.translation_direction_error_deg == pytest.approx(0, abs=1e-9)
    assert [f.baseline_error_percent for f in found.frames] == pytest.approx([0, 2, 0], abs=1e-9)
    # The surface file stores float32: 70.1 mm to 4e-6 mm.
    assert found.shape_rmse_mm == pytest.approx(0.1, abs=1e-5)
    assert found.shape_median_mm == pytest.approx(0.1, abs=1e-5)


def test_file_has_the_documented_keys(
    world: SimpleNamespace, folders: tuple[Path, Path], tmp_path: Path
):
    """Oracle: the list of keys in the documentation of `evaluate`, read by plain json."""
    found = evaluate(record_of(world), record_of(world), *folders)
    found.save(tmp_path / "metrics.json")
    data = json.loads((tmp_path / "metrics.json").read_text())
    assert data.keys() >= {
        "focal_error_percent", "rotation_error_deg", "translation_direction_error_deg",
        "baseline_error_percent", "shape_rmse_mm", "shape_median_mm", "coverage",
    }  # fmt: skip
    assert Metrics.model_validate_json((tmp_path / "metrics.json").read_text()) == found


def test_unobservable_focal_is_null_with_reason(world: SimpleNamespace, folders: tuple[Path, Path]):
    """Oracle: null, the reason carried over, and the other figures still there."""
    solution = with_focal(record_of(world), value=None, status="unobservable", reason="a plane")
    found = evaluate(solution, record_of(world), *folders)
    assert found.focal_error_percent is None
    assert "a plane" in found.reasons["focal_error_percent"]
    assert found.rotation_error_deg is not None
    assert found.shape_rmse_mm is not None


def test_focal_per_frame(world: SimpleNamespace, folders: tuple[Path, Path]):
    """Oracle: signed per frame, root mean square over frames: +3 %, 0, 0 gives sqrt(3) %."""
    focal = Estimate(value=1.03 * 120, status="measured")
    solution = with_frame(record_of(world), 0, focal=focal)
    found = evaluate(solution, record_of(world), *folders)
    assert [f.focal_error_percent for f in found.frames] == pytest.approx([3, 0, 0])
    assert found.focal_error_percent == pytest.approx(np.sqrt(3))


def test_up_to_scale(world: SimpleNamespace, tmp_path: Path, folders: tuple[Path, Path]):
    """Oracle: lengths divided by the baseline: no baseline error, shape compared after scaling."""
    baseline = float(np.linalg.norm(world.pose.t))
    unit = PoseEstimate.of(RigidTransform(world.pose.R, world.pose.t / baseline))
    solution = record_of(world, ["a.exr"], units="baseline", scale="up_to_scale")
    solution = with_frame(solution, 0, projector_from_camera=unit)
    true = world.sheet()
    small = SurfaceEstimate(true.vertices / baseline, true.faces)
    save_surface(tmp_path / "surface.ply", small)
    found = evaluate(solution, record_of(world, ["a.exr"]), tmp_path, folders[1])
    assert found.baseline_error_percent is None
    assert "up to scale" in found.reasons["baseline_error_percent"]
    assert found.translation_direction_error_deg == pytest.approx(0, abs=1e-9)
    assert found.alignment == "scale"
    assert found.alignment_scale == pytest.approx(baseline, rel=1e-6)
    assert found.shape_rmse_mm == pytest.approx(0, abs=1e-4)
    refused = evaluate(solution, record_of(world, ["a.exr"]), tmp_path, folders[1], "none")
    assert refused.shape_rmse_mm is None
    assert "up to scale" in refused.reasons["shape_rmse_mm"]


def test_first_frame_left_out(world: SimpleNamespace, tmp_path: Path):
    """Oracle: the surface moved into the second camera's frame fits the truth in the first's."""
    true = world.sheet(slope=(0.1, -0.2))
    (tmp_path / "truth").mkdir()
    save_surface(tmp_path / "truth" / "surface.ply", true)
    moved = SurfaceEstimate(CAMERA_POSES[1].inverse().apply(true.vertices), true.faces)
    save_surface(tmp_path / "surface.ply", moved)
    truth = record_of(world)
    solution = truth.model_copy(update={"frames": truth.frames[1:]})
    found = evaluate(solution, truth, tmp_path, tmp_path / "truth")
    assert [(f.name, f.truth) for f in found.frames] == [("b.exr", "b.exr"), ("c.exr", "c.exr")]
    assert found.shape_rmse_mm == pytest.approx(0, abs=1e-4)
    assert found.frames[1].camera_translation_error_mm == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"surface": None}, "the truth has no surface"),
        ({"units": "baseline", "scale": "up_to_scale"}, "the truth is up to scale"),
    ],
)
def test_shape_that_cannot_be_compared(
    world: SimpleNamespace, folders: tuple[Path, Path], change: dict, reason: str
):
    """Oracle: null with the reason; poses are compared all the same."""
    found = evaluate(record_of(world), record_of(world, **change), *folders)
    assert found.shape_rmse_mm is None
    assert found.coverage is None
    assert found.alignment is None
    assert found.reasons["shape_rmse_mm"] == reason
    assert found.rotation_error_deg is not None


def test_folder_not_given(world: SimpleNamespace):
    """Oracle: null with the reason."""
    found = evaluate(record_of(world), record_of(world))
    assert found.reasons["coverage"] == "the folder of the solution's surface is not given"


def test_missing_surface_file(world: SimpleNamespace, tmp_path: Path):
    """Oracle: a file that is named must be there."""
    with pytest.raises(InputError, match=r"surface.ply: no such file"):
        evaluate(record_of(world), record_of(world), tmp_path, tmp_path)


def test_images_of_another_size_are_refused(world: SimpleNamespace):
    """Oracle: the size that the test gave the truth; a side without camera tells nothing."""
    solution, truth = record_of(world), record_of(world)
    assert truth.camera is not None
    wider = truth.camera.model_copy(update={"width": 68})
    with pytest.raises(InputError, match=r"camera: images of 68 x 45 .* solution's are 67 x 45; "):
        evaluate(solution, truth.model_copy(update={"camera": wider}))
    evaluate(solution, truth.model_copy(update={"camera": None}))
