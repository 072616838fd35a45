"""The truth beside a result: found, brought into its unit and frame, compared."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration, SurfaceEstimate
from mitsuba_endo.records.solution import Outcome, PoseEstimate, Solution, save_solution
from mitsuba_endo.records.surface import save_surface
from mitsuba_endo.show.result_scene import ResultScene
from mitsuba_endo.show.truth import find_truth, load_truth, surface_error

Maker = Callable[..., Calibration]


@pytest.fixture(scope="module")
def calibration(make_calibration: Maker) -> Calibration:
    return make_calibration(width=64, height=46, count=2)


def write_truth(folder: Path, calibration: Calibration) -> Path:
    folder.mkdir(parents=True)
    changes = {"outcome": Outcome.TRUTH, "scale": "truth", "surface": "truth.ply"}
    save_solution(folder / "truth.json", calibration.solution.model_copy(update=changes))
    save_surface(folder / "truth.ply", calibration.surface)
    return folder / "truth.json"


def test_is_found_where_a_capture_lies(tmp_path: Path, calibration: Calibration):
    """Oracle: the demo's folders; a truth of other frames or another camera is not taken."""
    solution = calibration.solution
    result = tmp_path / "solution"
    result.mkdir()
    assert find_truth(result, solution) is None
    path = write_truth(tmp_path / "capture", calibration)
    assert find_truth(result, solution) == path
    assert find_truth(result / "solution.json", solution) == path
    frames = [f.model_copy(update={"name": f"other{i}"}) for i, f in enumerate(solution.frames)]
    assert find_truth(result, solution.model_copy(update={"frames": frames})) is None
    assert solution.camera is not None
    wider = solution.camera.model_copy(update={"width": 65})
    assert find_truth(result, solution.model_copy(update={"camera": wider})) is None
    shutil.copy(path, tmp_path / "truth.json")
    assert find_truth(result, solution) == tmp_path / "truth.json"
    path.write_text("{")
    assert find_truth(result, solution) == tmp_path / "truth.json"


def test_is_found_for_an_image_that_was_decoded(tmp_path: Path, calibration: Calibration):
    """Oracle: the demo's folders, where the frame is called as the capture's image; without such
    an image, or with two frames, a truth of other names is not taken."""

    def named(*names: str) -> Solution:
        frames = [
            frame.model_copy(update={"name": name})
            for frame, name in zip(calibration.solution.frames, names, strict=False)
        ]
        return calibration.solution.model_copy(update={"frames": frames})

    result = tmp_path / "solution"
    result.mkdir()
    one = replace(calibration, solution=named("map.exr"))
    path = write_truth(tmp_path / "capture", one)
    assert find_truth(result, named("image.exr")) is None
    (path.parent / "image.png").touch()
    assert find_truth(result, named("image.exr")) == path
    assert find_truth(result, named("photo.exr")) is None
    assert find_truth(result, named("image.exr", "second.exr")) is None


def test_error_is_along_the_rays(calibration: Calibration):
    """Oracle: a surface 1 % nearer than the truth: -1 % of the true range, whatever the direction;
    a ray beside the truth has none."""
    surface = calibration.surface
    middles = surface.vertices[surface.faces[::7]].mean(1)  # a ray through a vertex may slip by
    error = surface_error(SurfaceEstimate(0.99 * middles, surface.faces[:1]), surface)
    true = np.linalg.norm(middles, axis=1)
    # The sheet bends: at its rim a nearer part of it may hide what lies behind.
    alone = np.abs(middles[:, :2]).max(1) < 38
    np.testing.assert_allclose(error[alone], -0.01 * true[alone], atol=1e-6)
    half = replace(surface, faces=surface.faces[: len(surface.faces) // 4])
    assert np.isnan(surface_error(surface, half)).mean() > 0.3


def _in_baselines(solution: Solution, baseline: float) -> Solution:
    def shrunk(pose: PoseEstimate) -> PoseEstimate:
        transform = pose.to_transform()
        assert transform is not None
        return PoseEstimate.of(RigidTransform(transform.R, transform.t / baseline))

    frames = [
        f.model_copy(
            update={
                "projector_from_camera": shrunk(f.projector_from_camera),
                "world_from_camera": shrunk(f.world_from_camera),
            }
        )
        for f in solution.frames
    ]
    return solution.model_copy(
        update={"units": "baseline", "scale": "up_to_scale", "frames": frames}
    )


def test_up_to_scale_is_aligned(tmp_path: Path, calibration: Calibration):
    """Oracle: the same result in baselines has the same truth, in baselines, and no error."""
    path = write_truth(tmp_path / "capture", calibration)
    surface = calibration.surface
    unscaled = replace(
        calibration,
        solution=_in_baselines(calibration.solution, 6.2),
        surface=replace(surface, vertices=surface.vertices / 6.2),
    )
    scene = ResultScene(unscaled)
    scene.compare(path)
    assert scene.truth is not None
    assert scene.truth.alignment == "scale"
    for mine, true in zip(scene.poses, scene.truth.poses, strict=True):
        for a, b in (
            (mine.first_from_camera, true.first_from_camera),
            (mine.first_from_projector, true.first_from_projector),
        ):
            assert a is not None
            assert b is not None
            np.testing.assert_allclose(b.t, a.t, atol=1e-5)
    assert scene.errors is not None
    assert np.nanmax(np.abs(scene.errors[0])) < 1e-4
    assert [q.name for q in scene.quantities()] == ["uncertainty", "error to truth", "depth"]
    assert "baselines, scale aligned" in scene.quantities()[1].label


def test_frames_must_be_the_same(tmp_path: Path, calibration: Calibration, make_calibration: Maker):
    """Oracle: a truth with another number of frames, of other names."""
    path = write_truth(tmp_path / "capture", make_calibration(width=64, height=46))
    with pytest.raises(InputError, match="no frame of this name in the truth"):
        load_truth(path, calibration)
