"""Exports, each read back by the program it is for."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from mitsuba_endo import backend
from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.camera_files import read_camera_file
from mitsuba_endo.records.rig import Camera, load_rig
from mitsuba_endo.records.solution import Estimate, Solution, load_solution, save_solution
from mitsuba_endo.records.surface import load_surface, save_surface
from mitsuba_endo.show.exports import EXPORTERS, export
from mitsuba_endo.show.map_names import observed_names
from mitsuba_endo.show.read_folder import save_observed

POINTS = np.array([[3.0, -5.0, 62.0], [-14.0, 8.0, 75.0], [9.0, 11.0, 58.0]])
"""In the first camera's frame."""


def _write(folder: Path, calibration: Calibration, solution: Solution) -> Path:
    folder.mkdir()
    save_solution(folder / "solution.json", solution.model_copy(update={"surface": "surface.ply"}))
    save_surface(folder / "surface.ply", calibration.surface)
    return folder


def _with_projector(solution: Solution, **changes: object) -> Solution:
    projector = solution.projector.model_copy(update=changes)
    return solution.model_copy(update={"projector": projector})


@pytest.fixture(scope="module")
def calibration(make_calibration: Callable[..., Calibration]) -> Calibration:
    return make_calibration(width=64, height=46, count=2)


@pytest.fixture
def result(tmp_path: Path, calibration: Calibration) -> Path:
    """Two frames, law direction_cosine."""
    return _write(tmp_path / "result", calibration, calibration.solution)


@pytest.fixture
def pinhole(tmp_path: Path, calibration: Calibration) -> Path:
    """The same with a pinhole projector."""
    solution = _with_projector(calibration.solution, law="pinhole")
    return _write(tmp_path / "pinhole", calibration, solution)


def _expected(folder: Path, frame: int) -> np.ndarray:
    """Project POINTS, moved to a frame's camera, with this package's own geometry."""
    solution = load_solution(folder)
    first = solution.frames[0].world_from_camera.to_transform()
    world = solution.frames[frame].world_from_camera.to_transform()
    pose = solution.frames[frame].projector_from_camera.to_transform()
    model = solution.projector.to_model()
    assert first is not None
    assert world is not None
    assert pose is not None
    assert model is not None
    return model.project(pose.apply(world.inverse().apply(first.apply(POINTS))))


def test_opencv_projects_as_the_solution(pinhole: Path, tmp_path: Path):
    """Oracle: cv2.projectPoints with the matrices that cv2 reads back."""
    export(pinhole, "opencv", tmp_path / "out.yaml")
    storage = cv2.FileStorage(str(tmp_path / "out.yaml"), cv2.FILE_STORAGE_READ)
    K, d, R, T = (
        storage.getNode(n).mat()
        for n in ("projector_matrix", "projector_distortion_coefficients", "R", "T")
    )
    q, _ = cv2.projectPoints(POINTS, cv2.Rodrigues(R)[0], T, K, d)
    np.testing.assert_allclose(q[:, 0], _expected(pinhole, 0), atol=1e-9)
    frames = storage.getNode("frames")
    second = frames.at(1)
    assert frames.size() == 2
    assert second.getNode("name").string() == "run/frame_1.exr"
    world_R, world_T = second.getNode("world_R").mat(), second.getNode("world_T").mat()
    in_camera = (POINTS - world_T.T) @ world_R  # the first camera is the world here
    R, T = second.getNode("R").mat(), second.getNode("T").mat()
    K = second.getNode("projector_matrix").mat()
    q, _ = cv2.projectPoints(in_camera, cv2.Rodrigues(R)[0], T, K, d)
    np.testing.assert_allclose(q[:, 0], _expected(pinhole, 1), atol=1e-9)
    assert storage.getNode("projector_law").string() == "pinhole"
    storage.release()


def test_rig_file_takes_the_camera_from_it(result: Path, tmp_path: Path, calibration: Calibration):
    """Oracle: the solution's camera, after the way through OpenCV's file and a rig file."""
    export(result, "opencv", tmp_path / "camera.yaml")
    (tmp_path / "rig.yaml").write_text(
        "camera: camera.yaml\nprojector: {width: 1024, height: 768}\n", encoding="utf-8"
    )
    camera = load_rig(tmp_path / "rig.yaml").camera.to_model()
    np.testing.assert_allclose(camera.K, calibration.camera.K, rtol=1e-15)
    assert (camera.width, camera.height) == (64, 46)
    np.testing.assert_allclose(camera.distortion, [*calibration.camera.distortion, 0], rtol=1e-15)


def test_colmap_projects_as_the_solution(pinhole: Path, tmp_path: Path, calibration: Calibration):
    """Oracle: pycolmap's own projection, whose first pixel centre is (0.5, 0.5)."""
    pycolmap = pytest.importorskip("pycolmap")
    export(pinhole, "colmap", tmp_path / "model")
    model = pycolmap.Reconstruction(str(tmp_path / "model"))
    named = {image.name: image for image in model.images.values()}
    assert set(named) == {
        "run/frame_0.exr", "run/frame_1.exr",
        "projector/run/frame_0.exr", "projector/run/frame_1.exr",
    }  # fmt: skip
    for frame in (0, 1):
        image = named[f"projector/run/frame_{frame}.exr"]
        q = np.array([image.project_point(p) for p in POINTS]) - 0.5
        np.testing.assert_allclose(q, _expected(pinhole, frame), atol=1e-6)
    pixels = np.array([named["run/frame_0.exr"].project_point(p) for p in POINTS]) - 0.5
    np.testing.assert_allclose(pixels, calibration.camera.project(POINTS), atol=1e-6)
    assert len(model.points3D) == len(calibration.surface.vertices)
    found = np.array([model.points3D[i + 1].xyz for i in range(5)])
    np.testing.assert_allclose(found, calibration.surface.vertices[:5], atol=1e-4)  # float32 PLY


def test_colmap_tracks_are_the_correspondences(tmp_path: Path, calibration: Calibration):
    """Oracle: pycolmap's tracks: in the camera's image its own projection of the point, in the
    projector's the observed map read at that pixel, within five RMS residuals of the projection."""
    pycolmap = pytest.importorskip("pycolmap")
    pinhole = _with_projector(
        calibration.solution, law="pinhole", distortion=Estimate(value=[], status="fixed")
    )
    frames = []
    for k, frame in enumerate(calibration.frames):  # maps of the pinhole, with the same noise
        q = _pinhole_map(calibration, pinhole, k)
        noise = np.nan_to_num(frame.observed - frame.rendered)
        frames.append(replace(frame, observed=(q + noise).astype(np.float32)))
    folder = _write(tmp_path / "result", calibration, pinhole)
    for name, frame in zip(observed_names([f.name for f in frames]), frames, strict=True):
        save_observed(folder / name, frame)
    export(folder, "colmap", tmp_path / "model")
    model = pycolmap.Reconstruction(str(tmp_path / "model"))
    named = {image.name: image for image in model.images.values()}
    for k, frame in enumerate(frames):
        camera, projector = (named[f"{part}run/frame_{k}.exr"] for part in ("", "projector/"))
        assert len(camera.points2D) == len(projector.points2D) > 800
        for seen, lit in list(zip(camera.points2D, projector.points2D, strict=True))[::17]:
            assert seen.point3D_id == lit.point3D_id
            point = model.points3D[seen.point3D_id].xyz
            np.testing.assert_allclose(seen.xy, camera.project_point(point), atol=1e-6)
            x, y = np.round(seen.xy - 0.5).astype(int)
            around = frame.observed[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2].reshape(-1, 2)
            assert (np.nanmin(around, 0) - 1e-3 <= lit.xy - 0.5).all()
            assert (np.nanmax(around, 0) + 1e-3 >= lit.xy - 0.5).all()
            assert np.linalg.norm(lit.xy - projector.project_point(point)) < 5 * 0.31
    tracked = [p for p in model.points3D.values() if p.track.length()]
    assert {p.track.length() for p in tracked} == {2, 4}
    assert 0.05 < np.mean([p.error for p in tracked]) < 0.31


def _pinhole_map(calibration: Calibration, solution: Solution, frame: int) -> np.ndarray:
    """Project what a frame sees of the sheet by ray casting, NaN where nothing was observed."""
    pose = solution.frames[frame].projector_from_camera.to_transform()
    world = solution.frames[frame].world_from_camera.to_transform()
    model = solution.projector.to_model()
    assert pose is not None
    assert world is not None
    assert model is not None
    surface, camera = calibration.surface, calibration.camera
    caster = RayCaster(world.inverse().apply(surface.vertices), surface.faces)
    points = camera.grid_rays * range_image(caster, camera)[..., None]
    missing = ~np.isfinite(calibration.frames[frame].observed)
    return np.where(missing, np.nan, model.project(pose.apply(points)))


def test_colmap_refuses_what_it_cannot_express(result: Path, tmp_path: Path):
    """Oracle: COLMAP's list of camera models holds no direction cosines."""
    with pytest.raises(InputError, match=r"COLMAP has no camera like the law direction_cosine"):
        export(result, "colmap", tmp_path / "model")
    assert not (tmp_path / "model").exists()


def test_ply_keeps_the_std(result: Path, tmp_path: Path, calibration: Calibration):
    """Oracle: the calibration's surface, to the float32 of the file."""
    export(result, "ply", tmp_path / "out.ply")
    surface = load_surface(tmp_path / "out.ply")
    assert surface.std is not None
    assert calibration.surface.std is not None
    np.testing.assert_allclose(surface.vertices, calibration.surface.vertices, atol=1e-5)
    np.testing.assert_allclose(surface.std, calibration.surface.std, rtol=1e-6)


def test_mitsuba_loads_the_scene(result: Path, tmp_path: Path, calibration: Calibration):
    """Oracle: Mitsuba's parser; the scene has the film's size and the surface's vertices."""
    backend.use("llvm_ad_rgb")
    import mitsuba as mi

    export(result, "mitsuba", tmp_path / "scene")
    scene = mi.load_file(str(tmp_path / "scene" / "scene.xml"))
    assert tuple(scene.sensors()[0].film().size()) == (64, 46)
    assert scene.shapes()[0].vertex_count() == len(calibration.surface.vertices)


@pytest.mark.parametrize("name", ["opencv", "colmap", "mitsuba"])
def test_unknown_value_is_named(name: str, tmp_path: Path, calibration: Calibration):
    """Oracle: the field that is null, and its reason, in the message; nothing is written."""
    unknown = Estimate(value=None, status="unobservable", reason="the surface is one plane")
    solution = _with_projector(calibration.solution, law="pinhole", focal=unknown)
    folder = _write(tmp_path / "result", calibration, solution)
    out = tmp_path / "out.yaml"
    with pytest.raises(InputError, match=r"projector\.focal was not determined .*one plane"):
        export(folder, name, out)
    assert not out.exists()


def test_other_names_and_suffixes(result: Path, tmp_path: Path):
    """Oracle: the registry, and FileStorage's suffixes."""
    assert set(EXPORTERS) == {"opencv", "colmap", "ply", "mitsuba", "ros", "kalibr"}
    with pytest.raises(InputError, match=r"unknown format 'stl'"):
        export(result, "stl", tmp_path / "out.stl")
    with pytest.raises(InputError, match=r"unknown kind of file '\.txt'"):
        export(result, "opencv", tmp_path / "out.txt")


BROWN = (-0.12, 0.03, 1e-3, -2e-3)
CAMERAS = {
    "opencv": BROWN, "opencv_fisheye": (0.02, -0.01, 0.004, -0.001), "omni": (0.7, *BROWN),
    "double_sphere": (-0.2, 0.57), "scaramuzza": (0.0, -0.4),
}  # fmt: skip


def _seen_by(folder: Path, model: str) -> Path:
    """Replace the camera's model in a solution folder."""
    solution = load_solution(folder)
    assert solution.camera is not None
    camera = solution.camera.model_copy(update={"model": model, "distortion": [*CAMERAS[model]]})
    save_solution(folder / "solution.json", solution.model_copy(update={"camera": camera}))
    return folder


def _check_camera(path: Path, folder: Path) -> None:
    """Compare the camera of an exported file, read back, with the solution's at all its pixels."""
    file, _ = read_camera_file(path)
    camera = load_solution(folder).camera
    assert camera is not None
    read, own = Camera.model_validate(file.camera).to_model(), camera.to_model()
    pixels = own.pixel_grid()
    np.testing.assert_allclose(read.rays(pixels), own.rays(pixels), atol=1e-12)


@pytest.mark.parametrize("model", ["opencv", "opencv_fisheye", "omni", "double_sphere"])
def test_kalibr_projects_as_the_solution(pinhole: Path, tmp_path: Path, model: str):
    """Oracle: the camera read back, and cv2.projectPoints with cam1 and T_cn_cnm1 in metres."""
    export(_seen_by(pinhole, model), "kalibr", tmp_path / "chain.yaml")
    _check_camera(tmp_path / "chain.yaml#cam0", pinhole)
    projector = yaml.safe_load((tmp_path / "chain.yaml").read_text())["cam1"]
    fu, fv, pu, pv = projector["intrinsics"]
    T = np.array(projector["T_cn_cnm1"])
    K, lens = (
        np.array([[fu, 0, pu], [0, fv, pv], [0, 0, 1]]),
        np.array(projector["distortion_coeffs"]),
    )
    q, _ = cv2.projectPoints(
        POINTS / 1000, cv2.Rodrigues(T[:3, :3])[0], T[:3, 3], K, np.array(lens)
    )
    np.testing.assert_allclose(q[:, 0], _expected(pinhole, 0), atol=1e-9)


@pytest.mark.parametrize("model", ["opencv", "opencv_fisheye"])
def test_ros_projects_as_the_solution(pinhole: Path, tmp_path: Path, model: str):
    """Oracle: both cameras read back, and the projector's pose from the quaternion, in metres."""
    export(_seen_by(pinhole, model), "ros", tmp_path / "ros")
    _check_camera(tmp_path / "ros" / "camera.yaml", pinhole)
    file, note = read_camera_file(tmp_path / "ros" / "projector.yaml")
    assert "ROS camera_info" in note
    stamped = yaml.safe_load((tmp_path / "ros" / "transform.yaml").read_text())
    assert (stamped["header"]["frame_id"], stamped["child_frame_id"]) == ("camera", "projector")
    turn, shift = stamped["transform"]["rotation"], stamped["transform"]["translation"]
    R = Rotation.from_quat([turn[k] for k in "xyzw"]).as_matrix()
    local = (POINTS / 1000 - [shift[k] for k in "xyz"]) @ R  # X_projector = R^T (X_camera - t)
    q, _ = cv2.projectPoints(local, np.zeros(3), np.zeros(3), np.array(file.camera["K"]),
                             np.array(file.camera["distortion"]))  # fmt: skip
    np.testing.assert_allclose(q[:, 0], _expected(pinhole, 0), atol=1e-9)


def test_opencvs_omnidir_is_read_back(pinhole: Path, tmp_path: Path):
    """Oracle: the camera's rays."""
    export(_seen_by(pinhole, "omni"), "opencv", tmp_path / "c.yaml")
    _check_camera(tmp_path / "c.yaml", pinhole)


@pytest.mark.parametrize(
    ("model", "formats"),
    [
        ("scaramuzza", ("opencv", "colmap", "ros", "kalibr")),
        ("double_sphere", ("opencv", "colmap", "ros")),
        ("omni", ("colmap", "ros")),
    ],
)
def test_cameras_that_a_format_lacks_are_refused(pinhole: Path, tmp_path: Path, model, formats):
    """Oracle: the model's name, and no file."""
    _seen_by(pinhole, model)
    for name in formats:
        with pytest.raises(InputError, match=f"has no camera like the model {model}"):
            export(pinhole, name, tmp_path / "out.yaml")
        assert not (tmp_path / "out.yaml").exists()


@pytest.mark.parametrize("name", ["ros", "kalibr"])
def test_robots_formats_have_pinhole_projectors_only(result: Path, tmp_path: Path, name: str):
    """Oracle: the law's name."""
    with pytest.raises(InputError, match="has no camera like the law direction_cosine"):
        export(result, name, tmp_path / "out.yaml")


def test_a_fifth_coefficient_is_not_dropped(pinhole: Path, tmp_path: Path):
    """Oracle: Kalibr refuses k3, ROS takes eight coefficients."""
    solution = load_solution(pinhole)
    assert solution.camera is not None
    lens = [*BROWN, 5e-3, 0.01, 0.002, 1e-4]
    camera = solution.camera.model_copy(update={"model": "opencv", "distortion": lens})
    save_solution(pinhole / "solution.json", solution.model_copy(update={"camera": camera}))
    with pytest.raises(InputError, match="Kalibr has four coefficients only"):
        export(pinhole, "kalibr", tmp_path / "chain.yaml")
    export(pinhole, "ros", tmp_path / "ros")
    file, _ = read_camera_file(tmp_path / "ros" / "camera.yaml")
    assert file.camera["distortion"] == lens
    assert file.named == "rational_polynomial"
