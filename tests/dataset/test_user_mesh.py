from pathlib import Path

import numpy as np
import pytest
import trimesh

from mitsuba_endo.dataset.run import failures
from mitsuba_endo.dataset.scene_ranges import Scene
from mitsuba_endo.dataset.user_mesh import load_user_mesh, note
from mitsuba_endo.errors import InputError
from mitsuba_endo.records.surface import load_surface
from mitsuba_endo.rendering.scene_surfaces import scene_mesh
from mitsuba_endo.shapes import Mesh, make_shape
from tests.dataset.small import make_here, small_config

pytestmark = pytest.mark.usefixtures("llvm")


def given(path: Path, **keys) -> Scene:
    return Scene.model_validate({"kind": "file", "file": str(path), **keys})


def ball(path: Path, radius: float = 40.0, inside_out: bool = False) -> Path:
    mesh = trimesh.creation.icosphere(3, radius)
    if inside_out:
        mesh.faces = mesh.faces[:, ::-1]
    mesh.export(path)
    return path


def tube(path: Path, inside_out: bool = False) -> Path:
    """Write a bent tube with open ends, whose faces look inwards unless inside out."""
    mesh = make_shape("colon", length=90, radius=18, fold_depth=3, edge=4, closed_end=False)
    faces = mesh.faces[:, ::-1] if inside_out else mesh.faces
    Mesh(mesh.vertices, faces).save(path)
    return path


def outward(mesh: Mesh) -> float:
    """Return the share of a ball's faces whose normals point away from its centre."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(((normals * corners.mean(1)).sum(1) > 0).mean())


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize(("side", "share"), [("outside", 1.0), ("inside", 0.0)])
def test_faces_are_turned_to_the_side_of_the_camera(tmp_path, inside_out, side, share):
    """Oracle: a ball's normals against its radius, wound either way."""
    mesh = load_user_mesh(given(ball(tmp_path / "b.stl", inside_out=inside_out), side=side))
    assert outward(mesh) == share


@pytest.mark.parametrize("inside_out", [False, True])
def test_an_open_tube_is_turned_inwards(tmp_path, inside_out):
    """Oracle: the generator's own faces, which look inwards."""
    mesh = load_user_mesh(given(tube(tmp_path / "t.ply", inside_out), side="inside"))
    right = load_user_mesh(given(tube(tmp_path / "r.ply"), side="front"))
    assert np.array_equal(np.sort(mesh.faces, 1), np.sort(right.faces, 1))
    normals = [np.cross(*(m.vertices[m.faces[:, i]] - m.vertices[m.faces[:, 0]] for i in (1, 2)))
               for m in (mesh, right)]  # fmt: skip
    assert ((normals[0] * normals[1]).sum(1) > 0).all()


def test_metres_are_found_out_and_can_be_said(tmp_path):
    """Oracle: the same ball in both units; one without a believable size in either."""
    with pytest.raises(InputError, match=r"as if in metres.*try unit: m"):
        load_user_mesh(given(ball(tmp_path / "b.ply", 0.04), side="outside"))
    mesh = load_user_mesh(given(tmp_path / "b.ply", side="outside", unit="m"))
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 40).max() < 1e-3
    with pytest.raises(InputError, match="correct the scene's unit"):
        load_user_mesh(given(ball(tmp_path / "c.ply", 4e4), side="outside"))


def test_what_cannot_be_a_surface_is_refused(tmp_path):
    """Oracle: one mistake a file."""
    with pytest.raises(InputError, match="no such file"):
        load_user_mesh(given(tmp_path / "none.ply"))
    (tmp_path / "text.ply").write_text("no mesh")
    with pytest.raises(InputError, match="not a readable mesh"):
        load_user_mesh(given(tmp_path / "text.ply"))
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "points.ply")
    with pytest.raises(InputError, match="no triangles"):
        load_user_mesh(given(tmp_path / "points.ply"))
    make_shape("plane", edge=8).save(tmp_path / "plane.ply")
    with pytest.raises(InputError, match="two sides cannot be told apart"):
        load_user_mesh(given(tmp_path / "plane.ply", side="inside"))
    mesh = make_shape("plane", edge=8)
    faces = mesh.faces.copy()
    faces[::3] = faces[::3, ::-1]
    Mesh(mesh.vertices, faces).save(tmp_path / "mixed.ply")
    with pytest.raises(InputError, match="wound against each other"):
        load_user_mesh(given(tmp_path / "mixed.ply"))


def test_a_non_manifold_surface_is_used_and_its_flaw_noted(tmp_path):
    """Oracle: a fin put on one edge of a sheet, which then joins three faces."""
    mesh = make_shape("plane", edge=4)
    middle = len(mesh.vertices) // 2
    fin = np.vstack([mesh.vertices, mesh.vertices[middle] + [0, 0, -3]])
    face = [middle, middle + 1, len(mesh.vertices)]
    Mesh(fin, np.vstack([mesh.faces, face])).save(tmp_path / "fin.ply")
    prepared = load_user_mesh(given(tmp_path / "fin.ply"))
    assert note(prepared)["edges_of_three_or_more_faces"] == 1
    config = small_config(scenes=[{"kind": "file", "file": str(tmp_path / "fin.ply")}])
    assert make_here(config, tmp_path / "out", 1).done == 1


SCENE = """<scene version="3.0.0">
  <default name="shape" value="shape:plane?edge=20"/>
  <shape type="ply" id="a"><string name="filename" value="$shape"/></shape>
  <shape type="obj" id="b"><string name="filename" value="{obj}"/></shape>
  <shape type="sphere" id="c"/>
</scene>"""


def test_a_mitsuba_scene_gives_its_meshes(tmp_path):
    """Oracle: the two meshes' own sizes; the sphere is none."""
    trimesh.creation.box((4, 5, 6)).export(tmp_path / "box.obj")
    (tmp_path / "s.xml").write_text(SCENE.format(obj=tmp_path / "box.obj"))
    mesh = scene_mesh(tmp_path / "s.xml")
    plane = make_shape("plane", edge=20)
    assert len(mesh.faces) == len(plane.faces) + 12
    assert mesh.bounds[1] == pytest.approx([40, 40, 70])
    assert load_user_mesh(given(tmp_path / "s.xml")).bounds == pytest.approx(mesh.bounds)


def test_an_empty_scene_is_refused(tmp_path):
    """Oracle: a scene of a sphere alone, and one of nothing."""
    for content in ('<shape type="sphere"/>', ""):
        (tmp_path / "e.xml").write_text(f'<scene version="3.0.0">{content}</scene>')
        with pytest.raises(InputError, match="holds no triangle mesh"):
            load_user_mesh(given(tmp_path / "e.xml"))
    (tmp_path / "broken.xml").write_text("<scene>")
    with pytest.raises(InputError, match="not valid XML"):
        load_user_mesh(given(tmp_path / "broken.xml"))


def test_samples_of_a_users_tube_are_made_and_no_file_is_needed_any_more(tmp_path):
    """Oracle: the number of samples; the surface's checksum guards against another file."""
    config = small_config(
        scenes=[{"kind": "file", "file": str(tube(tmp_path / "t.ply")), "side": "inside"}]
    )
    done = make_here(config, tmp_path / "out", 2)
    assert (done.done, failures(tmp_path / "out")) == (2, [])
    ball(tmp_path / "t.ply")
    with pytest.raises(InputError, match="begun with another surfaces"):
        make_here(config, tmp_path / "out", 3)


def test_a_vertex_that_no_triangle_has_may_be_nowhere(tmp_path):
    """Oracle: the ball without it."""
    mesh = trimesh.creation.icosphere(3, 40.0)
    vertices = np.vstack([mesh.vertices, [[np.nan] * 3], [[9e5] * 3]])
    trimesh.Trimesh(vertices, mesh.faces, process=False).export(tmp_path / "b.ply")
    loaded = load_user_mesh(given(tmp_path / "b.ply", side="outside"))
    np.testing.assert_allclose(loaded.bounds, mesh.bounds, atol=1e-4)
    surface = load_surface(tmp_path / "b.ply")
    assert np.isfinite(surface.vertices).all()
    assert len(surface.vertices) == len(vertices)


def test_far_from_the_origin(tmp_path):
    """Oracle: the same ball about the origin; a thousand kilometres off, in double precision."""
    mesh = trimesh.creation.icosphere(3, 40.0)
    lines = [f"v {x + 8e8:.6f} {y - 5e8:.6f} {z:.6f}" for x, y, z in mesh.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces]
    (tmp_path / "b.obj").write_text("\n".join(lines))
    loaded = load_user_mesh(given(tmp_path / "b.obj", side="outside"))
    np.testing.assert_allclose(np.sort(loaded.vertices, 0), np.sort(mesh.vertices, 0), atol=1e-5)
