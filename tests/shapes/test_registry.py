"""Shapes by name: what every one promises, and what bad parameters answer."""

import numpy as np
import pytest
import trimesh

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes import SHAPES, make_shape, parameter_names

ALL = ["box_planes", "bumpy_sheet", "colon", "concave_sphere", "plane", "rabbit", "stomach"]


@pytest.fixture(scope="module")
def meshes():
    return {name: make_shape(name) for name in ALL}


def test_every_shape_is_registered():
    assert sorted(SHAPES) == ALL


@pytest.mark.parametrize("name", ALL)
def test_is_a_clean_manifold(meshes, name):
    """Oracle: trimesh's independent topology checks, and brute-force duplicate search."""
    mesh = meshes[name].to_trimesh()
    assert mesh.is_winding_consistent
    assert mesh.body_count == 1
    assert mesh.area_faces.min() > 1e-4  # mm^2; a typical face has 0.1 to 0.6
    assert len(np.unique(meshes[name].vertices.round(6), axis=0)) == len(mesh.vertices)
    assert len(np.unique(mesh.faces)) == len(mesh.vertices), "a vertex belongs to no face"
    _, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    assert count.max() == 2, "an edge joins more than two faces"


@pytest.mark.parametrize("name", ALL)
def test_faces_the_camera(meshes, name):
    """Oracle: the first surface that a ray from the origin meets shows its front side."""
    mesh = meshes[name].to_trimesh()
    slope = np.random.default_rng(0).uniform(-0.25, 0.25, (60, 2))
    rays = np.column_stack([slope, np.ones(60)])
    corners = mesh.triangles
    normals = mesh.face_normals
    met = 0
    for ray in rays:
        # Moller-Trumbore over all triangles at once.
        e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        p = np.cross(ray, e2)
        det = (e1 * p).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (-corners[:, 0] * p).sum(axis=1) / det
            q = np.cross(-corners[:, 0], e1)
            v = (q @ ray) / det
            t = (e2 * q).sum(axis=1) / det
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1)
        if hit.any():
            met += 1
            first = np.flatnonzero(hit)[np.argmin(t[hit])]
            assert normals[first] @ ray < 0
    assert met >= 15


@pytest.mark.parametrize("name", ALL)
def test_default_size_and_texture(meshes, name):
    """Millimetres within an endoscope's reach, 36k to 62k triangles, texture in [0, 1]."""
    mesh = meshes[name]
    assert 36_000 < len(mesh.faces) < 62_000
    low, high = mesh.bounds
    assert 30 < high[2] < 200
    assert np.all(high - low <= 210)
    assert mesh.uv is not None
    assert mesh.uv.shape == (len(mesh.vertices), 2)
    assert mesh.uv.min() >= 0
    assert mesh.uv.max() <= 1
    assert np.all(np.ptp(mesh.uv, axis=0) > 0.9)


def test_saved_file_holds_the_mesh(tmp_path):
    """Oracle: trimesh reads back what was saved, to float32 (1e-5 mm at 100 mm)."""
    mesh = make_shape("bumpy_sheet", width=50, edge=4)
    mesh.save(tmp_path / "sheet.ply")
    back = trimesh.load_mesh(tmp_path / "sheet.ply", process=False)
    np.testing.assert_allclose(back.vertices, mesh.vertices, atol=1e-5)
    np.testing.assert_array_equal(back.faces, mesh.faces)
    header = (tmp_path / "sheet.ply").read_bytes()[:600]
    assert b"float u" in header
    assert b"float v" in header


@pytest.mark.parametrize("name", ["colon", "stomach"])
def test_seed_decides(name):
    """The same seed gives the same bits, another seed a surface that differs by over 1 mm."""
    one, again, other = (make_shape(name, seed=s, edge=3) for s in (4, 4, 5))
    np.testing.assert_array_equal(one.vertices, again.vertices)
    assert one.vertices.shape == other.vertices.shape
    assert np.abs(one.vertices - other.vertices).max() > 1


@pytest.mark.parametrize(
    ("name", "params", "says"),
    [
        ("cube", {}, "choose one of box_planes, bumpy_sheet"),
        ("plane", {"wdth": 3}, "plane: wdth: .*choose among distance, width, height"),
        ("plane", {"width": -3}, "plane: width: .*greater than 0, not -3"),
        ("plane", {"width": float("nan")}, "plane: width: .*finite"),
        ("plane", {"height": "tall"}, "plane: height: .*valid number"),
        ("plane", {"edge": 1e-4}, "plane: edge: .*longer edge"),
        ("bumpy_sheet", {"radius": 20}, "bumpy_sheet: radius: .*half the sheet's diagonal"),
        ("stomach", {"seed": -1}, "stomach: seed"),
        ("colon", {"bend": 1.3, "length": 40}, "colon: bend: .*reduce bend"),
        ("colon", {"fold_depth": 30}, "colon: fold_depth"),
        ("rabbit", {"edge": 8}, "rabbit: edge"),
    ],
)
def test_bad_input_names_the_field(name, params, says):
    with pytest.raises(InputError, match=says):
        make_shape(name, **params)


def test_parameter_names():
    assert parameter_names("plane") == ("distance", "width", "height", "tilt_x", "tilt_y", "edge")
