"""A stack in one's own order and a ROS file: one command."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from mitsuba_endo.api.inputs import as_correspondences, as_rig
from mitsuba_endo.decoding.conventions import StackOrder
from mitsuba_endo.decoding.stack_patterns import patterns
from mitsuba_endo.decoding.stack_plan import StackPlan
from mitsuba_endo.errors import InputError
from mitsuba_endo.records.solution import load_solution
from tests.cli.inputs import run
from tests.decoding.captures import POSE, SIZE, inner, photograph, view

VIEW = view()


def _bring(folder: Path) -> None:
    """Write what a stranger has: rows first, all bits before all phases, white and black last."""
    plan = StackPlan.make("gray+phase", *SIZE)
    seen = dict(zip(plan.labels(), photograph(VIEW, patterns(plan)).images, strict=True))
    order = [*StackOrder(rows_first=True, by_axis=False).labels(plan), "white", "black"]
    (folder / "photos").mkdir()
    for k, label in enumerate(order):
        image = np.rint(255 * seen[label]).astype(np.uint8)
        cv2.imwrite(str(folder / "photos" / f"DSC_{k + 1}.png"), image)
    camera = VIEW.rig.camera
    ros = {
        "image_width": camera.width, "image_height": camera.height, "camera_name": "head",
        "camera_matrix": {"rows": 3, "cols": 3, "data": camera.K.ravel().tolist()},
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5,
                                    "data": [float(v) for v in camera.distortion]},
    }  # fmt: skip
    (folder / "head.yaml").write_text(yaml.safe_dump(ros))
    rig = {
        "units": "mm", "camera": "head.yaml",
        "projector": {"law": "pinhole", "width": SIZE[0], "height": SIZE[1], "centre": [128, 105]},
        "scale": {"baseline": float(np.linalg.norm(POSE.t))},
    }  # fmt: skip
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))


@pytest.mark.usefixtures("llvm")
def test_one_command(tmp_path: Path):
    """Oracle: the focal length, 255, and the pose of the rig that took the photographs."""
    _bring(tmp_path)
    result = run("calibrate", tmp_path / "photos", "--pattern", "stack", "--rig",
                 tmp_path / "rig.yaml", "--out", tmp_path / "r")  # fmt: skip
    assert result.exit_code == 0, result.stderr
    said = " ".join(result.stdout.split())
    assert "rows-first,gray-code,coarse-first,bits-first,by-kind,shift-forward,offset=0" in said
    assert "ROS camera_info" in said
    solution = load_solution(tmp_path / "r")
    assert solution.projector.focal.value == pytest.approx(255, abs=0.3)
    pose = solution.frames[0].projector_from_camera.to_transform()
    assert pose is not None
    np.testing.assert_allclose(pose.t, POSE.t, atol=0.05)
    assert (tmp_path / "r" / "decoded" / "photos.exr").is_file()


def test_from_python(tmp_path: Path):
    """Oracle: ray casting."""
    _bring(tmp_path)
    rig = as_rig(tmp_path / "rig.yaml")
    (map_,) = as_correspondences([tmp_path / "photos"], rig, "stack", True)
    apart = np.abs(map_.q - VIEW.rig.q)[inner(VIEW)]
    assert np.nanmedian(apart) < 0.1
    with pytest.raises(InputError, match="is no stack"):
        as_correspondences([tmp_path / "photos" / "DSC_1.png"], rig, "gray", True)


def test_what_does_not_go_with_a_stack(tmp_path: Path):
    """Oracle: the sentence names the option."""
    _bring(tmp_path)
    given = ("calibrate", tmp_path / "photos", "--rig", tmp_path / "rig.yaml", "--out",
             tmp_path / "r", "--pattern", "stack")  # fmt: skip
    for options, named in (
        (("--no-refine",), "--no-refine"),
        (("--map-convention", "one-based"), "--map-convention"),
    ):
        result = run(*given, *options)
        assert result.exit_code == 2
        assert named in result.stderr
    (tmp_path / "b").mkdir()
    (tmp_path / "photos").rename(tmp_path / "b" / "photos")
    _bring(tmp_path)
    result = run("calibrate", tmp_path / "b" / "photos", *given[1:])
    assert "two stacks have this name" in result.stderr
