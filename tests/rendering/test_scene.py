"""Loading scenes: parameters, accessors, and mistakes that a user makes."""

from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.rendering import keys
from mitsuba_endo.rendering.axes import to_world_from_pose
from mitsuba_endo.rendering.generated import describe
from mitsuba_endo.rendering.scene import find_scene, load_scene, packaged_scenes
from mitsuba_endo.shapes import make_shape

SMALL = {"width": 64, "height": 48, "fx": 55, "cx": 30.5, "cy": 25.0}


def test_the_packaged_scenes_are_listed() -> None:
    """Oracle: the issue's list."""
    assert packaged_scenes() == ["colon", "plane", "rabbit", "sheet", "sphere", "stomach"]


@pytest.mark.parametrize("name", packaged_scenes())
def test_every_scene_loads_with_its_ids(name: str, llvm: str) -> None:
    """Camera, projector and surface are there, and their optimised parameters have stable keys."""
    import mitsuba as mi

    loaded = load_scene(name)
    assert loaded.camera().width == 480
    assert loaded.camera().height == 360
    assert loaded.pattern_size() == (480, 384)
    assert len(loaded.surface().faces) > 1000
    params = mi.traverse(loaded.scene)
    wanted = [keys.vertex_positions(), keys.focal(), *keys.centre(), keys.aspect(),
              *keys.distortion(), keys.to_world("camera"), keys.to_world("projector"),
              *keys.intrinsics(), *keys.lens("opencv")]  # fmt: skip
    assert [k for k in wanted if k not in params] == []


def test_accessors_return_what_was_set(llvm: str) -> None:
    """Oracle: the parameters given."""
    surface = describe("shape", "bumpy_sheet", edge=4.0)
    loaded = load_scene(
        "sheet", **SMALL, fy=57, k1=-0.1, k3=0.02, law="direction_cosine", focal=321, centre_x=200,
        aspect=1.02, projector_k1=-0.05, surface=surface,
        camera_origin="1, 2, 3", camera_target="1, 2, 4",
    )  # fmt: skip
    camera, projector = loaded.camera(), loaded.projector()
    np.testing.assert_allclose(camera.K, [[55, 0, 30.5], [0, 57, 25], [0, 0, 1]])
    np.testing.assert_allclose(camera.distortion, [-0.1, 0, 0, 0, 0.02], atol=1e-7)
    assert (projector.law, projector.focal) == ("direction_cosine", 321)
    assert projector.centre == (200, 191.5)
    assert projector.aspect == pytest.approx(1.02)
    np.testing.assert_allclose(projector.distortion.coefficients, [-0.05, 0, 0, 0, 0], atol=1e-7)
    np.testing.assert_allclose(loaded.world_from_camera().R, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(loaded.world_from_camera().t, [1, 2, 3], atol=1e-6)
    expected = make_shape("bumpy_sheet", edge=4.0)
    got = loaded.surface()
    np.testing.assert_allclose(got.vertices, expected.vertices, atol=1e-5)
    np.testing.assert_array_equal(got.faces, expected.faces)
    assert loaded.parameters["focal"] == "321"


def test_pose_written_through_the_keys_is_read_back(llvm: str) -> None:
    """keys, axes and accessors agree on where the projector is."""
    import mitsuba as mi

    loaded = load_scene("plane", **SMALL)
    moved = loaded.world_from_projector().perturbed(np.array([0.1, -0.2, 0.05, 1, 2, -3]))
    params = mi.traverse(loaded.scene)
    key = keys.to_world(keys.PROJECTOR)
    params[key] = type(params[key])(mi.ScalarAffineTransform4f(to_world_from_pose(moved).tolist()))
    params.update()
    np.testing.assert_allclose(loaded.world_from_projector().matrix(), moved.matrix(), atol=1e-5)


def test_a_scene_file_of_the_user(llvm: str, tmp_path: Path) -> None:
    """A copy of a packaged scene elsewhere loads the same; a mesh file may stand for a shape."""
    copy = tmp_path / "mine.xml"
    copy.write_text(find_scene("plane").read_text())
    make_shape("plane", edge=20.0).save(tmp_path / "mesh.ply")
    loaded = load_scene(copy, surface=str(tmp_path / "mesh.ply"), **SMALL)
    assert len(loaded.surface().vertices) == len(make_shape("plane", edge=20.0).vertices)


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"focl": 300}, r"sheet: has no parameter 'focl'; it has surface,.* focal,"),
        ({"law": "fresnel"}, r"^sheet: doe_projector: unknown \"law\" 'fresnel', expected one of "),
        ({"k1": "inf"}, r'^sheet: endoscope: "k1" must be a finite number, got inf; '),
        ({"projector_origin": "1e39, 0, 0"}, r'^sheet: doe_projector: "to_world" must be finite'),
        ({"light": "nan"}, "parameter 'light' is nan; give it a number"),
        ({"tissue": "0.7, NaN, 0.3"}, "parameter 'tissue' is 0.7, NaN, 0.3"),
        ({"width": "wide"}, "width|integer|wide"),
        ({"surface": "missing.ply"}, "missing.ply"),
        ({"surface": "shape:colonn"}, "no shape called 'colonn'"),
        ({"surface": "shape:colon?folds=9"}, "folds"),
        ({"surface": "shape:colon?seed"}, "shape:NAME"),
        ({"pattern": "pattern:dots"}, "no pattern called 'dots'"),
    ],
)
def test_mistaken_parameters(parameters: dict, said: str, llvm: str) -> None:
    """Each is one InputError that names the culprit."""
    with pytest.raises(InputError, match=said) as caught:
        load_scene("sheet", **parameters)
    assert "\n" not in str(caught.value)
    assert "Traceback" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<scene version='3.0.0'><sensor></scene>", "not valid XML"),
        ("<html></html>", "starts with <html>"),
        ("<scene version='3.0.0'><lens type='x'/></scene>", "lens"),
        ("<scene version='3.0.0'></scene>", "no endoscope sensor with the id 'camera'"),
    ],
)
def test_mistaken_files(text: str, said: str, llvm: str, tmp_path: Path) -> None:
    """Each is one InputError that names the file."""
    path = tmp_path / "broken.xml"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        load_scene(path)
    assert "broken.xml" in str(caught.value)


def test_missing_file(llvm: str) -> None:
    """The packaged scenes are offered."""
    with pytest.raises(InputError, match=r"nowhere.xml: no such scene file; .*colon"):
        load_scene("nowhere.xml")
