"""The package in a few calls, as a program uses it. Oracle: the truth of synthetic views."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

import mitsuba_endo as me
from mitsuba_endo import backend
from mitsuba_endo.errors import NothingDecodedError
from mitsuba_endo.records.correspondence import CorrespondenceMap, save_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.records.rig import Camera
from mitsuba_endo.solve.options import Options
from tests.cli.inputs import run
from tests.decoding.grid_views import CAMERA, photo, view
from tests.decoding.grid_views import SIZE as GRID_SIZE
from tests.solve.views import POSE, Views, look, projector_poses, relief_surface, steps

QUICK = Options(jackknife=False, check_model=False)


@pytest.fixture(scope="module")
def case() -> tuple[Views, me.Result]:
    """Two views of one surface, and what one call makes of their arrays."""
    views = look(relief_surface(), steps(2), projector_poses(2))
    rig = views.rig().model_dump(mode="json")
    return views, me.calibrate([m.q for m in views.maps], rig, options=QUICK)


def _middle(truth: np.ndarray) -> tuple[slice, slice]:
    h, w = truth.shape[:2]
    return slice(h // 5, -h // 5), slice(w // 5, -w // 5)


def test_importing_loads_nothing():
    """Oracle: the modules of a fresh process, and its clock: 0.1 s for the package alone."""
    code = (
        "import sys, time; t = time.process_time(); import mitsuba_endo as me; "
        "t = time.process_time() - t; assert 'calibrate' in dir(me); "
        "print(t < 0.1, sorted({'numpy', 'mitsuba', 'pydantic'} & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split(maxsplit=1) == ["True", "[]\n"]


def test_every_public_name_is_there():
    """Oracle: ``__all__``; another name is refused as by any module."""
    assert all(hasattr(me, name) for name in me.__all__)
    assert callable(me.decode)
    assert not hasattr(me, "nothing")


def test_depth_of_every_frame(case: tuple[Views, me.Result]):
    """Oracle: the points that each camera sees, in its own frame."""
    views, result = case
    assert result.unit == "mm"
    assert result.names == ["frame_0", "frame_1"]
    for k, name in enumerate(result.names):
        points, truth = result.points(k), views.points[k]
        inside = _middle(truth)
        error = np.linalg.norm(points - truth, axis=-1)[inside]
        assert np.isfinite(error).mean() > 0.95
        assert np.nanmedian(error) < 0.3
        np.testing.assert_array_equal(result.depth(name), points[..., 2])
    np.testing.assert_array_equal(result.depth(-1), result.depth(1))


def test_poses_with_covariances(case: tuple[Views, me.Result]):
    """Oracle: the truth, and the standard deviations of the solution."""
    views, result = case
    first, second = result.poses()
    assert first.camera_covariance is None  # the first camera is the world
    assert second.world_from_camera is not None
    error = second.world_from_camera.t - views.world_from_camera[1].t
    assert second.camera_covariance is not None
    sigma = np.sqrt(np.diag(second.camera_covariance))
    assert (np.abs(error) < 4 * sigma[3:] + 1e-9).all()
    assert (sigma[3:] < 1.0).all()
    for pose, frame in zip((first, second), result.solution.frames, strict=True):
        covariance = pose.projector_covariance
        assert covariance is not None
        np.testing.assert_allclose(covariance, covariance.T, rtol=1e-9, atol=1e-15)
        assert np.linalg.eigvalsh(covariance).min() > -1e-12
        std = frame.projector_from_camera.std
        assert std is not None
        np.testing.assert_allclose(np.sqrt(np.diag(covariance)), std, rtol=1e-12)


@pytest.mark.parametrize("frame", [0, 1])
def test_distance(case: tuple[Views, me.Result], frame: int):
    """Oracle: the distance of the true points of two pixels."""
    views, result = case
    a, b = (30.0, 25.0), (75.0, 60.0)
    truth = np.linalg.norm(
        views.points[frame][int(a[1]), int(a[0])] - views.points[frame][int(b[1]), int(b[0])]
    )
    found = result.distance(a, b, frame)
    assert found.std is not None
    assert abs(found.value - truth) < 4 * found.std
    assert found.std < 0.02 * truth
    assert "mm (95 %)" in found.words(result.solution)


def test_saved_and_loaded(case: tuple[Views, me.Result], tmp_path: Path):
    """Oracle: the result in memory; a surface file holds single precision."""
    _, result = case
    result.save(tmp_path / "out", extras=["depth"])
    again = me.load(tmp_path / "out")
    assert again.solution.projector == result.solution.projector
    assert again.rig == result.rig
    np.testing.assert_allclose(again.depth(1), result.depth(1), rtol=1e-5)
    assert again.verdict == result.verdict
    for k in (0, 1):
        (path,) = (tmp_path / "out").glob(f"depth_0{k}_*.exr")
        np.testing.assert_allclose(read_exr(path)["Z"], result.depth(k), rtol=1e-6)
    assert "2 frames, converged" in repr(again)
    assert "mitsuba-endo" in again._repr_html_()


def test_frames_with_surfaces_of_their_own():
    """Oracle: the points of each frame, whose surface is in its own camera's frame."""
    views = look(relief_surface(), steps(2), [POSE] * 2)
    share = {"surface": "per_frame", "projector_pose": "shared"}
    result = me.calibrate(views.maps, views.rig(), share=share, options=QUICK)
    for k in (0, 1):
        inside = _middle(views.points[k])
        error = (result.points(k) - views.points[k])[inside]
        assert np.nanmedian(np.linalg.norm(error, axis=-1)) < 0.3


def test_maps_of_any_kind(case: tuple[Views, me.Result], tmp_path: Path):
    """Oracle: map and rig as files; the same map of another type, order and writability."""
    views, _ = case
    map_, rig = views.maps[0], tmp_path / "rig.yaml"
    rig.write_text(yaml.safe_dump(views.rig().model_dump(mode="json")), encoding="utf-8")
    save_map(tmp_path / "map.exr", map_.q)
    double = np.asfortranarray(map_.q.astype(np.float64))
    double.flags.writeable = False
    values = [
        me.calibrate(given, rig, options=QUICK).solution.projector.focal.value
        for given in (str(tmp_path / "map.exr"), double, replace(map_, q=double))
    ]
    assert values[1:] == pytest.approx([values[0]] * 2, rel=1e-6)


@pytest.fixture
def grid_rig() -> dict:
    return {
        "camera": Camera.from_model(CAMERA).model_dump(),
        "projector": {"law": "direction_cosine", "width": GRID_SIZE[0], "height": GRID_SIZE[1]},
    }


def test_decode_and_calibrate_an_image(llvm: str, tmp_path: Path, grid_rig: dict):
    """Oracle: the view's exact coordinates; a file and its array give one map."""
    q = view("sheet")
    image = photo(q)
    assert cv2.imwrite(str(tmp_path / "frame.png"), image)
    of_file = me.decode(tmp_path / "frame.png", grid_rig)
    of_array = me.decode(image, grid_rig)
    np.testing.assert_array_equal(of_file.q, of_array.q)
    error = np.abs(of_file.q - q)
    assert np.nanmedian(error) < 0.5
    plain = me.decode(image, grid_rig, refine=False)
    assert not np.array_equal(plain.q, of_file.q, equal_nan=True)
    result = me.calibrate(tmp_path / "frame.png", grid_rig, options=QUICK)
    assert result.names == ["frame"]
    assert result.calibration.photographs["frame"].shape == (*q.shape[:2], 3)
    _same_report(result, tmp_path, grid_rig)
    with pytest.raises(NothingDecodedError):
        me.decode(np.full_like(image, 90), grid_rig)


def _same_report(result: me.Result, folder: Path, rig: dict) -> None:
    """Oracle: the report of the command: as many pictures, and the same photograph."""
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig), encoding="utf-8")
    image, out = str(folder / "frame.png"), str(folder / "command")
    run("calibrate", image, "--rig", str(folder / "rig.yaml"), "--out", out, "--quiet")
    result.save(folder / "python")
    kept, told = (
        folder / name / "decoded" / "frame_photograph.jpg" for name in ("python", "command")
    )
    assert kept.read_bytes() == told.read_bytes()
    mine, theirs = (
        (folder / name / "report.html").read_text("utf-8") for name in ("python", "command")
    )
    for text in ('alt="photograph frame', "<img ", "Photograph, observed and rendered maps"):
        assert mine.count(text) == theirs.count(text) > 0, text


def test_render(llvm: str):
    """Oracle: what was asked for."""
    capture = me.render("plane", spp=1, width=40, height=30, fx=30, cx=19.5, cy=14.5)
    assert capture.depth.shape == (30, 40)


@pytest.mark.parametrize(
    ("call", "what"),
    [
        (lambda r: r.depth(7), r"frame: there is no frame 7; give 0 to 1, or a name such as"),
        (lambda r: r.depth("view9"), "there is no frame 'view9'"),
        (lambda r: r.distance((-40, -40), (5, 5)), r"a: pixel \(-40, -40\) of frame_0 sees no"),
        (lambda r: me.calibrate(3, {}), "rig: "),
        (lambda r: me.calibrate(3, r.rig), "captures: is 'int' and no capture"),
        (lambda r: me.calibrate([3], r.rig), r"captures\[0\]: is 'int' and no capture"),
        (lambda r: me.calibrate(np.zeros((4, 4)), r.rig), r"captures\[0\]: is an array \(4, 4\)"),
        (lambda r: me.calibrate([], r.rig), "no correspondence map is given"),
        (lambda r: me.calibrate("nowhere.exr", r.rig), "nowhere.exr"),
        (lambda r: me.calibrate("nowhere.exr", 3), "rig: is 'int' and no rig"),
        (lambda r: me.calibrate(r.calibration.frames[0].observed, r.rig, pattern="gray"),
         "pattern: is for images"),
        (lambda r: me.calibrate(r.calibration.frames[0].observed, r.rig, share={"focal": "no"}),
         "share: focal"),
        (lambda r: me.decode(np.zeros((3, 3), int), r.rig), r"image: is an array \(3, 3\) of int"),
        (lambda r: me.load("nowhere"), "nowhere"),
    ],
)  # fmt: skip
def test_refused(case: tuple[Views, me.Result], call, what: str):
    """Oracle: one sentence that names the argument."""
    with pytest.raises(me.InputError, match=what):
        call(case[1])


def test_a_variant_without_derivatives(case: tuple[Views, me.Result]):
    """Oracle: a sentence, not a failure inside the solver; afterwards all is as before."""
    import mitsuba as mi

    views, _ = case
    before = backend.ensure()
    try:
        mi.set_variant("scalar_rgb")
        with pytest.raises(me.InputError, match="Mitsuba: has the variant scalar_rgb active"):
            me.calibrate(views.maps[0], views.rig())
    finally:
        mi.set_variant(before)


def test_generators_and_names(case: tuple[Views, me.Result]):
    """Oracle: the maps' own names, in their order."""
    views, _ = case
    maps = (CorrespondenceMap(m.q, f"frame {k}") for k, m in enumerate(views.maps))
    result = me.calibrate(maps, views.rig(), options=replace(QUICK, max_iterations=1))
    assert result.names == ["frame 0", "frame 1"]
