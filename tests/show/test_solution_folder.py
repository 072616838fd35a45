"""The solution folder: complete or absent, readable by others, a scene that renders itself."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.records.rig import Rig, load_rig
from mitsuba_endo.records.solution import Estimate, LeftOut, PoseEstimate, load_solution
from mitsuba_endo.records.surface import load_surface
from mitsuba_endo.records.trajectory import load_tum
from mitsuba_endo.show import solution_folder
from mitsuba_endo.show.map_names import map_names
from mitsuba_endo.show.scene_file import save_scene
from mitsuba_endo.show.solution_folder import write_solution_folder
from mitsuba_endo.show.trajectory_files import frame_rows

SIZE = {"width": 64, "height": 46}
PICTURES = {
    "overview.png", "observed.png", "rendered.png", "residual.png", "histogram.png",
    "surface.png", "convergence.png",
}  # fmt: skip
EXTRA = {"depth.exr", "points.ply", "mask.png"}
FILES = {
    "solution.json",
    "surface.ply",
    "scene.xml",
    "trace.csv",
    "frames.csv",
    "trajectory_camera.tum",
    "trajectory_projector.tum",
    "history.npz",
    "rendered.exr",
    "observed.exr",
    "report.html",
    ".mitsuba-endo",
}
Maker = Callable[..., Calibration]


@pytest.fixture(scope="module")
def calibration(make_calibration: Maker) -> Calibration:
    return make_calibration(**SIZE)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory, calibration: Calibration) -> Path:
    path = tmp_path_factory.mktemp("results") / "out"
    write_solution_folder(path, calibration, extras=("depth", "points", "masks", "pictures"))
    return path


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the report, which takes a second and is not what these tests look at."""
    monkeypatch.setattr(solution_folder, "save_report", lambda *_: None)


def test_files(written: Path):
    """Oracle: the list in the documentation."""
    assert {p.name for p in written.iterdir()} == FILES | PICTURES | EXTRA


def test_solution_is_the_calibrations(written: Path, calibration: Calibration):
    """Oracle: the record, plus the surface's file name."""
    expected = calibration.solution.model_copy(update={"surface": "surface.ply"})
    assert load_solution(written) == expected


def test_surface_is_the_calibrations(written: Path, calibration: Calibration):
    """Oracle: the arrays, in float32: 70 mm to 4e-6 mm."""
    loaded = load_surface(written / "surface.ply")
    np.testing.assert_allclose(loaded.vertices, calibration.surface.vertices, atol=4e-6)
    np.testing.assert_array_equal(loaded.faces, calibration.surface.faces)
    np.testing.assert_allclose(loaded.std, calibration.surface.std, rtol=1e-6)


def test_rendered_map(written: Path, calibration: Calibration):
    """Oracle: the array to the last bit."""
    loaded = load_map(written / "rendered.exr")
    np.testing.assert_array_equal(loaded.q, calibration.frames[0].rendered)


def test_trace(written: Path, calibration: Calibration):
    """Oracle: the iterations, read by the csv module."""
    with (written / "trace.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(calibration.trace)
    for row, expected in zip(rows, calibration.trace, strict=True):
        found = {k: float(v) if v else None for k, v in row.items()}
        assert found == {k: v for k, v in vars(expected).items() if k != "lengths"}


def test_depth_points_and_mask(written: Path, calibration: Calibration):
    """Oracle: the surface itself: each point lies in the plane of a triangle, to float32."""
    depth = read_exr(written / "depth.exr")["Z"]
    cloud = trimesh.load(written / "points.ply")
    points = np.asarray(cloud.vertices)
    assert len(points) == np.isfinite(depth).sum() > 1000
    np.testing.assert_allclose(points[:, 2], depth[np.isfinite(depth)], rtol=1e-6)
    surface = calibration.surface
    distance = distance_to_mesh(points[::20], surface.vertices, surface.faces)
    assert distance.max() < 1e-4
    mask = cv2.imread(str(written / "mask.png"), cv2.IMREAD_UNCHANGED)
    frame = calibration.frames[0]
    np.testing.assert_array_equal(mask == 255, frame.used)
    np.testing.assert_array_equal(mask > 0, np.isfinite(frame.observed).all(-1) | frame.used)


def test_frames_and_trajectories(written: Path, calibration: Calibration):
    """Oracle: the solution's poses, to nine digits; a frame's number is its time."""
    frame = calibration.solution.frames[0]
    (row,) = csv.DictReader((written / "frames.csv").read_text("utf-8").splitlines())
    assert row["name"] == frame.name
    assert [float(row[f"projector_{a}"]) for a in "xyz"] == pytest.approx(
        frame.projector_from_camera.t, rel=1e-8
    )
    assert frame.projector_from_camera.std is not None
    assert float(row["projector_std_x"]) == pytest.approx(
        frame.projector_from_camera.std[3], rel=1e-8
    )
    assert float(row["rms_px"]) == pytest.approx(frame.rms_px, rel=1e-8)
    assert 0 < float(row["coverage"]) < 1
    pose = frame.projector_from_camera.to_transform()
    assert pose is not None
    ((time, found),) = load_tum(written / "trajectory_projector.tum")
    assert time == 0
    np.testing.assert_allclose(found.matrix(), pose.inverse().matrix(), atol=1e-7)


def test_frames_left_out_are_rows_too(calibration: Calibration):
    """Oracle: the reason."""
    left = [LeftOut(name="dark", reason="it shows nothing")]
    rows = frame_rows(calibration.solution.model_copy(update={"left_out": left}))
    assert [(r.number, r.name, r.lost) for r in rows[1:]] == [(1, "dark", "it shows nothing")]


def test_nothing_extra_unless_asked(tmp_path: Path, calibration: Calibration):
    """Oracle: the list in the documentation; an unknown name is refused before anything is."""
    write_solution_folder(tmp_path / "out", calibration)
    assert {p.name for p in (tmp_path / "out").iterdir()} == FILES
    with pytest.raises(InputError, match="extras: 'deep' is unknown; choose from depth"):
        write_solution_folder(tmp_path / "no", calibration, extras=["deep"])
    assert not (tmp_path / "no").exists()


def test_pictures_are_readable(written: Path):
    """Oracle: OpenCV's reader."""
    for name in PICTURES:
        image = cv2.imread(str(written / name))
        assert image is not None
        assert min(image.shape[:2]) > 300


def _rendered_by_scene(folder: Path) -> np.ndarray:
    import mitsuba as mi

    scene = mi.load_file(str(folder / "scene.xml"))
    return np.array(mi.render(scene, integrator=mi.load_dict({"type": "projector_coords"})))


def test_scene_renders_the_same_coordinates(written: Path, calibration: Calibration):
    """Oracle: the rendered map, which came from NumPy's camera and projector models.

    1e-2 px: single precision keeps 1e-3 px, the rest is room for a ray along an edge.
    """
    rendered = _rendered_by_scene(written)[..., :2]
    expected = calibration.frames[0].rendered
    np.testing.assert_array_equal(np.isfinite(rendered), np.isfinite(expected))
    np.testing.assert_allclose(rendered, expected, atol=1e-2)
    assert np.isfinite(expected).mean() > 0.8


def test_scene_renders_as_it_is(written: Path):
    """Oracle: an image with light in it: a white wall has radiance 1 in the bright squares."""
    import mitsuba as mi

    image = np.array(mi.render(mi.load_file(str(written / "scene.xml")), spp=2))
    assert image.shape == (SIZE["height"], SIZE["width"], 3)
    assert 0.3 < np.percentile(image, 95) < 2


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("opencv_fisheye", (0.05, -0.01, 0.002, 0.0)),
        ("omni", (0.2, -0.05, 0.01, 1e-3, -1e-3)),
        ("double_sphere", (-0.2, 0.57)),
        ("scaramuzza", (0.01, -0.4, 0.05, -0.05, 2e-3, -1e-3)),
    ],
)
def test_wide_angle_scene_renders_the_same_coordinates(
    tmp_path: Path,
    calibration: Calibration,
    no_report: None,
    model: str,
    coefficients: tuple[float, ...],
):
    """Oracle: NumPy's camera meeting a sphere's mesh; projector coordinates to 1e-2 px."""
    import mitsuba as mi

    from mitsuba_endo.evaluate.depth import RayCaster, range_image

    K = np.array([[25.0, 0, 30], [0, 26, 24], [0, 0, 1]])
    camera = CameraModel(model, 64, 46, K, coefficients)
    surface = calibration.surface
    points = camera.grid_rays
    points = points * range_image(RayCaster(surface.vertices, surface.faces), camera)[..., None]
    projector = calibration.solution.projector.to_model()
    pose = calibration.solution.frames[0].projector_from_camera.to_transform()
    assert projector is not None
    assert pose is not None
    expected = projector.project(pose.apply(points))
    assert 0.2 < np.isfinite(expected).mean() < 0.9
    solution_folder.save_surface(tmp_path / "s.ply", surface)
    save_scene(tmp_path / "scene.xml", camera, projector, (1024, 768), pose, "s.ply", 70.0)
    scene = mi.load_file(str(tmp_path / "scene.xml"))
    rendered = np.array(mi.render(scene, integrator=mi.load_dict({"type": "projector_coords"})))
    # Rays in single precision meet the rim of the mesh a hair earlier or later.
    both = np.isfinite(rendered[..., :2]) & np.isfinite(expected)
    assert (both != np.isfinite(expected)).mean() < 0.002
    np.testing.assert_allclose(rendered[..., :2][both], expected[both], atol=1e-2)


UNKNOWN = {"status": "unobservable", "reason": "the surface is a plane"}


def _with_focal(calibration: Calibration, focal: Estimate) -> Calibration:
    solution = calibration.solution
    projector = solution.projector.model_copy(update={"focal": focal})
    return replace(calibration, solution=solution.model_copy(update={"projector": projector}))


def _with_frame(calibration: Calibration, **changes: Any) -> Calibration:
    solution = calibration.solution
    frames = [solution.frames[0].model_copy(update=changes), *solution.frames[1:]]
    return replace(calibration, solution=solution.model_copy(update={"frames": frames}))


@pytest.mark.usefixtures("no_report")
@pytest.mark.parametrize("what", ["intrinsics", "pose"])
def test_no_scene_without_its_values(tmp_path: Path, calibration: Calibration, what: str):
    """Oracle: no scene.xml, null in solution.json, and a warning that names what is missing."""
    if what == "intrinsics":
        changed = _with_focal(calibration, Estimate(value=None, **UNKNOWN))
    else:
        pose = PoseEstimate(R=None, t=None, **UNKNOWN)
        changed = _with_frame(calibration, projector_from_camera=pose)
    returned = write_solution_folder(tmp_path / "out", changed)
    assert not (tmp_path / "out" / "scene.xml").exists()
    data = json.loads((tmp_path / "out" / "solution.json").read_text())
    assert data["warnings"] == returned.warnings
    (warning,) = returned.warnings
    assert "scene.xml is left out" in warning
    assert what in warning


def test_unknown_values_do_not_stop_the_pictures(tmp_path: Path, calibration: Calibration):
    """Oracle: all pictures are there although focal length and pose are null."""
    changed = _with_focal(calibration, Estimate(value=None, **UNKNOWN))
    unknown = PoseEstimate(R=None, t=None, **UNKNOWN)
    changed = _with_frame(changed, projector_from_camera=unknown)
    write_solution_folder(tmp_path / "out", changed, extras=["pictures"])
    assert {p.name for p in (tmp_path / "out").iterdir()} >= PICTURES | {"report.html"}


@pytest.mark.usefixtures("no_report")
def test_focal_per_frame_goes_into_the_scene(tmp_path: Path, calibration: Calibration):
    """Oracle: projector coordinates scale about the centre with the first frame's own focal."""
    own = Estimate(value=450.0, status="measured")
    changed = _with_frame(_with_focal(calibration, Estimate(value=None, **UNKNOWN)), focal=own)
    write_solution_folder(tmp_path / "out", changed)
    rendered = _rendered_by_scene(tmp_path / "out")[..., :2]
    centre = np.array(calibration.solution.projector.centre.value)
    np.testing.assert_allclose(
        rendered - centre, (calibration.frames[0].rendered - centre) / 2, atol=1e-2
    )


@pytest.mark.usefixtures("no_report")
def test_several_frames(tmp_path: Path, make_calibration: Maker):
    """Oracle: one map a frame, names made safe for a file system, none twice."""
    calibration = make_calibration(**SIZE, count=3)
    write_solution_folder(tmp_path / "out", calibration)
    names = map_names([frame.name for frame in calibration.frames])
    assert names == [f"rendered_{i:02d}_run_frame_{i}.exr" for i in range(3)]
    for name, frame in zip(names, calibration.frames, strict=True):
        np.testing.assert_array_equal(load_map(tmp_path / "out" / name).q, frame.rendered)


@pytest.mark.usefixtures("no_report")
def test_rig_is_saved_with_its_defaults(tmp_path: Path, calibration: Calibration):
    """Oracle: the rig itself, read back; the pattern's size is taken from it where missing."""
    rig = Rig.model_validate(
        {
            "camera": {"width": 64, "height": 46, "K": calibration.camera.K.tolist()},
            "projector": {"width": 1024, "height": 768, "focal": 900},
        }
    )
    solution = calibration.solution
    projector = solution.projector.model_copy(update={"width": None, "height": None})
    changed = replace(calibration, solution=solution.model_copy(update={"projector": projector}))
    write_solution_folder(tmp_path / "out", changed, rig)
    assert load_rig(tmp_path / "out" / "rig.yaml") == rig
    assert (tmp_path / "out" / "scene.xml").exists()
    returned = write_solution_folder(tmp_path / "out", changed)
    assert "the pattern's size" in returned.warnings[0]
    assert not (tmp_path / "out" / "rig.yaml").exists()


@pytest.mark.parametrize("existing", [True, False])
def test_interrupted_leaves_the_old_or_nothing(
    tmp_path: Path, calibration: Calibration, monkeypatch: pytest.MonkeyPatch, existing: bool
):
    """Oracle: the folder's content before Ctrl-C fell into the drawing of the pictures."""
    out = tmp_path / "out"
    monkeypatch.setattr(solution_folder, "save_report", lambda *_: None)
    if existing:
        write_solution_folder(out, calibration)
    before = sorted(str(p) for p in tmp_path.rglob("*"))

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(solution_folder, "save_report", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_solution_folder(out, calibration)
    assert sorted(str(p) for p in tmp_path.rglob("*")) == before


def test_foreign_folder_is_refused(tmp_path: Path, calibration: Calibration):
    """Oracle: the sentence, and the foreign file untouched."""
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="choose an empty folder"):
        write_solution_folder(tmp_path, calibration)
    assert [p.name for p in tmp_path.iterdir()] == ["notes.txt"]
