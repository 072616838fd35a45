"""Cast views against plain geometry."""

import json

import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.endoscope import Endoscope
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.learn.cache import CacheSettings, open_cache
from mitsuba_endo.learn.scenes import KINDS, random_endoscope, random_surface
from mitsuba_endo.learn.views import BIT_EDGE, BIT_HIT, LATTICE_UNIT, UNLIT, make_view
from mitsuba_endo.shapes import make_shape

SMALL = CacheSettings(views=3, width=40, height=32, per_surface=2, seed=4)


def test_view_of_a_plane(llvm):
    """Oracle: the projection of the plane's points in closed form, at samples half a pixel apart;
    no pixel is an edge; irradiance falls with the square of the distance."""
    from mitsuba_endo.rendering.synthetic import MeshScene

    mesh = make_shape("plane", width=260.0, height=260.0, edge=4.0, tilt_x=0.2, tilt_y=-0.1)
    K = np.array([[70.0, 0, 38.0], [0, 72.0, 30.0], [0, 0, 1]])
    camera = CameraModel("opencv", 80, 60, K)
    own = RigidTransform.of([0.05, -0.08, 0.1], [-5.0, 1.0, 0.5])
    endoscope = Endoscope(
        camera, RigidTransform.identity(), projector_model("pinhole", 8.0, (0, 0)), own
    )
    view = make_view(MeshScene(mesh.vertices, mesh.faces), endoscope)
    corners = mesh.vertices[mesh.faces[0]]
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    rays = camera.rays(camera.pixel_grid())
    points = rays * ((normal @ corners[0]) / (rays @ normal))[..., None]
    expected = endoscope.projector.project(own.apply(points))
    found = view.lattice * LATTICE_UNIT
    np.testing.assert_allclose(found, expected, atol=LATTICE_UNIT)
    assert view.flags.shape == (30, 40)
    assert ((view.flags & BIT_EDGE) == 0).all()
    assert ((view.flags & BIT_HIT) > 0).all()
    # Sampled at every second ray, from the second on.
    source = own.inverse().t
    way = source - points[1::2, 1::2]
    length = np.linalg.norm(way, axis=-1)
    cosine = np.abs(way @ normal) / length / np.linalg.norm(normal)
    ratio = view.shading[..., 0] / (cosine / length**2)
    np.testing.assert_allclose(ratio / ratio.mean(), 1, atol=0.03)


def test_a_cache_repeats_and_is_kept(llvm, tmp_path):
    """Oracle: equal arrays of two makings; an opened cache is not made again."""
    first = open_cache(tmp_path / "a", SMALL)
    assert len(first) == 3
    assert first.kinds[0] == first.kinds[1]
    assert first.lattice.shape == (3, 64, 80, 2)
    second = open_cache(tmp_path / "b", SMALL)
    np.testing.assert_array_equal(first.lattice, second.lattice)
    np.testing.assert_array_equal(first.shading, second.shading)
    before = (tmp_path / "a" / "lattice.npy").stat().st_mtime_ns
    again = open_cache(tmp_path / "a", SMALL)
    assert (tmp_path / "a" / "lattice.npy").stat().st_mtime_ns == before
    view = again.view(2)
    np.testing.assert_array_equal(view.flags, first.flags[2])
    other = open_cache(tmp_path / "a", CacheSettings(views=1, width=40, height=32, seed=5))
    assert len(other) == 1
    assert json.loads((tmp_path / "a" / "settings.json").read_text())["settings"]["seed"] == 5


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_mostly_seen_and_lit(llvm, kind):
    """Oracle: the endoscope stands before or inside the surface, and its projector aims at it."""
    from mitsuba_endo.rendering.synthetic import MeshScene

    rng = np.random.default_rng(11)
    mesh = random_surface(kind, rng)
    scene = MeshScene(mesh.vertices, mesh.faces)
    views = [make_view(scene, random_endoscope(kind, (48, 36), 2, rng)) for _ in range(4)]
    assert np.mean([(v.flags & BIT_HIT) > 0 for v in views]) > 0.8
    lit = np.stack([v.lattice[..., 0] != UNLIT for v in views])
    assert lit.mean() > 0.5
    if kind in ("tube", "occluders"):
        assert np.mean([(v.flags & BIT_EDGE) > 0 for v in views]) > 0.003


def test_the_rabbit_is_kept_for_tests():
    assert "rabbit" not in KINDS
