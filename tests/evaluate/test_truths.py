"""Several truths: files, a folder of captures, and rigs that do not go together."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.errors import evaluate
from mitsuba_endo.evaluate.truths import load_truths
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.records.solution import PoseEstimate, Solution, save_solution
from mitsuba_endo.records.surface import own_surface_name, save_surface
from tests.evaluate.records import CAMERA_POSES, record_of, with_focal

pytestmark = pytest.mark.usefixtures("llvm")


def _captures(folder: Path, world: SimpleNamespace, names: list[str]) -> list[Path]:
    """Write captures as ``render`` does: one frame each, all called ``map``, in one world."""
    out = []
    for k, name in enumerate(names):
        (folder / name).mkdir(parents=True)
        truth = record_of(world, ["map"])
        frame = truth.frames[0].model_copy(
            update={"world_from_camera": PoseEstimate.of(CAMERA_POSES[k], status="fixed")}
        )
        save_solution(folder / name / "truth.json", truth.model_copy(update={"frames": [frame]}))
        save_surface(folder / name / "surface.ply", world.sheet(70.0 + 5 * k))
        out.append(folder / name)
    return out


def _solution(folder: Path, world: SimpleNamespace, names: list[str]) -> Solution:
    """Write a solution whose frames have surfaces of their own, 0.1 mm too far."""
    folder.mkdir()
    order = {"c1": 0, "c2": 1, "c10": 2}
    for k, name in enumerate(names):
        true = 70.0 + 5 * order[name.split("/")[0]]
        save_surface(folder / own_surface_name(k), world.sheet(true + 0.1 * (k + 1)))
    still = PoseEstimate.of(CAMERA_POSES[0], status="fixed")
    record = record_of(world, names, outcome="converged", scale="baseline")
    frames = [f.model_copy(update={"world_from_camera": still}) for f in record.frames]
    return record.model_copy(update={"frames": frames})


def test_a_folder_of_captures(world: SimpleNamespace, tmp_path: Path):
    """Oracle: every frame against the capture of its folder: 0.1 mm, 0.2 mm and so on of its own
    surface, in whatever order the folders sort."""
    _captures(tmp_path / "captures", world, ["c1", "c2", "c10"])
    names = ["c10/map.exr", "c1/map.exr", "c2/map.exr"]
    solution = _solution(tmp_path / "solution", world, names)
    truths = load_truths([tmp_path / "captures"])
    assert [known[0] for known in truths.names] == ["c1/map", "c2/map", "c10/map"]
    found = evaluate(solution, truths, tmp_path / "solution")
    assert [(f.name, f.truth) for f in found.frames] == [
        ("c10/map.exr", "c10/map"), ("c1/map.exr", "c1/map"), ("c2/map.exr", "c2/map"),
    ]  # fmt: skip
    errors = [f.shape_rmse_mm for f in found.frames]
    assert errors == pytest.approx([0.1, 0.2, 0.3], abs=1e-4)
    assert found.shape_rmse_mm == pytest.approx(0.1, abs=1e-4)
    assert found.matched_by == "name"


def test_several_truths_by_their_files(world: SimpleNamespace, tmp_path: Path):
    """Oracle: the same as the folder of both; a photograph's name is one of its frame's."""
    first, second = _captures(tmp_path, world, ["c1", "c2"])
    (second / "image.png").touch()
    truths = load_truths([second / "truth.json", first])
    assert truths.names == [("c2/map", "c2/image.png"), ("c1/map",)]
    assert truths.match(record_of(world, ["c1/map.exr", "c2/image.exr"])) == ([1, 0], "name")
    assert truths.owners == [0, 1]


def test_cameras_of_several_truths_share_a_world(world: SimpleNamespace, tmp_path: Path):
    """Oracle: a solution with the true camera poses has no error of them."""
    captures = _captures(tmp_path, world, ["c1", "c2", "c10"])
    solution = record_of(world, [f"{c.name}/map.exr" for c in captures])
    found = evaluate(solution, load_truths(captures))
    assert [f.camera_translation_error_mm for f in found.frames] == pytest.approx([0, 0, 0])
    assert found.reasons["shape_rmse_mm"] == "the folder of the solution's surface is not given"


def test_focal_lengths_may_differ_from_capture_to_capture(world: SimpleNamespace, tmp_path: Path):
    """Oracle: the second capture's projector focused 2 % longer."""
    captures = _captures(tmp_path, world, ["c1", "c2"])
    longer = with_focal(record_of(world, ["map"]), value=122.4, status="fixed")
    save_solution(captures[1] / "truth.json", longer)
    found = evaluate(record_of(world, ["c1/map", "c2/map"]), load_truths(captures))
    assert [f.focal_error_percent for f in found.frames] == pytest.approx([0, 100 / 1.02 - 100])


def test_truths_of_other_rigs_are_refused(world: SimpleNamespace, tmp_path: Path):
    """Oracle: the file that differs, by name."""
    captures = _captures(tmp_path, world, ["c1", "c2"])
    other = record_of(world, ["map"])
    assert other.camera is not None
    wider = Camera.model_validate(other.camera.model_dump() | {"width": 99})
    save_solution(captures[1] / "truth.json", other.model_copy(update={"camera": wider}))
    with pytest.raises(InputError, match="c2: has another camera than the first truth"):
        load_truths(captures)
    law = other.projector.model_copy(update={"law": "pinhole"})
    save_solution(captures[1] / "truth.json", other.model_copy(update={"projector": law}))
    with pytest.raises(InputError, match="c2: has another projector"):
        load_truths(captures)
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match="holds no calibration"):
        load_truths([empty])
