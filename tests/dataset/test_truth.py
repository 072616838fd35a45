import numpy as np
import pytest

from mitsuba_endo.dataset.truth import truth_maps
from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.endoscope import Endoscope
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.synthetic import MeshScene
from mitsuba_endo.shapes.colon import Colon
from mitsuba_endo.shapes.concave_sphere import ConcaveSphere
from mitsuba_endo.shapes.mesh import Mesh
from mitsuba_endo.shapes.polyp import Polyp

CAMERA = CameraModel("opencv", 64, 44, np.array([[52.0, 0, 30.6], [0, 51.0, 22.3], [0, 0, 1]]))
GRID = CodedGrid(width=200, height=160, columns=14, rows=11, period=11.0, seed=4)
PROJECTOR = projector_model("pinhole", 190.0, (98.0, 81.0))
PROJECTOR_FROM_CAMERA = RigidTransform.of([0.02, -0.05, 0.1], [-6.0, 1.5, 0.7])
WALL, FLAP = 60.0, 35.0
"""z of a wall that fills the view, and of a rectangle before it, mm."""
EDGES = (-4.1, 7.3, -6.2, 3.15)
"""x and y of the rectangle's sides, mm."""


def rectangle(x0: float, x1: float, y0: float, y1: float, z: float) -> Mesh:
    vertices = np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]])
    return Mesh(vertices, np.array([[0, 3, 1], [1, 3, 2]]))


def flap_before_wall() -> Mesh:
    wall, flap = rectangle(-80, 80, -70, 70, WALL), rectangle(*EDGES, FLAP)
    return Mesh(np.vstack([wall.vertices, flap.vertices]), np.vstack([wall.faces, flap.faces + 4]))


def maps_of(mesh: Mesh, world_from_camera: RigidTransform):
    """Return the truth of a mesh given in the camera's frame, the world elsewhere."""
    moved = Mesh(world_from_camera.apply(mesh.vertices), mesh.faces)
    scene = MeshScene(moved.vertices, moved.faces)
    endoscope = Endoscope(CAMERA, world_from_camera, PROJECTOR, PROJECTOR_FROM_CAMERA)
    return truth_maps(scene, moved, endoscope, GRID)


WORLD_FROM_CAMERA = RigidTransform.of([0.4, -0.3, 1.1], [12.0, -7.0, 30.0])


def flap_geometry():
    """Return points seen (h, w, 3), whether on the flap, and whether lit, by plane geometry."""
    rays = CAMERA.rays(CAMERA.pixel_grid())
    rays = rays / rays[..., 2:]

    def inside(p):
        x0, x1, y0, y1 = EDGES
        return (p[..., 0] > x0) & (p[..., 0] < x1) & (p[..., 1] > y0) & (p[..., 1] < y1)

    on_flap = inside(FLAP * rays)
    points = np.where(on_flap[..., None], FLAP * rays, WALL * rays)
    light = PROJECTOR_FROM_CAMERA.inverse().t
    share = (FLAP - light[2]) / (points[..., 2] - light[2])
    crossing = light + share[..., None] * (points - light)
    return points, on_flap, on_flap | ~inside(crossing)


@pytest.mark.usefixtures("llvm")
def test_a_flap_before_a_wall_is_as_plane_geometry_has_it():
    """Oracle: intersections of rays with two planes, written out; the shadow by similar triangles.

    Single-precision rays put pixels within 1e-4 of an edge on either side: none is so near.
    """
    maps = maps_of(flap_before_wall(), WORLD_FROM_CAMERA)
    points, _, reached = flap_geometry()
    q = PROJECTOR.project(PROJECTOR_FROM_CAMERA.apply(points))
    on_pattern = ((q >= -0.5) & (q <= np.array([199.5, 159.5]))).all(-1)
    assert np.array_equal(maps.visible, on_pattern & reached)
    assert np.array_equal(maps.shadow, on_pattern & ~reached)
    assert 20 < maps.shadow.sum() < 500
    assert maps.camera.all()
    assert maps.depth == pytest.approx(points[..., 2], abs=1e-3)
    assert maps.q == pytest.approx(q, abs=1e-2)
    assert maps.normals == pytest.approx(np.broadcast_to([0, 0, -1.0], points.shape), abs=1e-5)


@pytest.mark.usefixtures("llvm")
def test_phase_node_and_code_are_those_of_the_pattern():
    """Oracle: the grid's nodes and code array, looked up by the nearest node's distance."""
    maps = maps_of(flap_before_wall(), WORLD_FROM_CAMERA)
    known = maps.node[..., 0] >= 0
    assert known.sum() > 500
    column, row = maps.node[known].T
    nodes = GRID.nodes[row, column]
    away = (maps.q[known] - nodes) / GRID.period
    assert np.abs(away).max() <= 0.5 + 1e-5
    wrapped = np.angle(np.exp(1j * (maps.phase[known] - 2 * np.pi * away)))
    assert np.abs(wrapped).max() < 1e-4
    assert np.array_equal(maps.code[known], GRID.code[row, column])
    assert np.isnan(maps.phase[~known]).all()


@pytest.mark.usefixtures("llvm")
def test_mixed_pixels_lie_along_the_flap_and_the_shadow():
    """Oracle: each mixed pixel has an unlit neighbour or one at another depth; flat ones have not.

    On the wall q changes by 190/60 x 60/52 = 3.7 pattern pixels a pixel, more than a quarter of
    the period of 11, so that a coarser pattern is used here.
    """
    maps = maps_of(flap_before_wall(), RigidTransform.identity())
    assert np.array_equal(maps.mixed, maps.visible)
    coarse = CodedGrid(width=200, height=160, columns=4, rows=3, period=44.0, seed=4)
    mesh = flap_before_wall()
    scene = MeshScene(mesh.vertices, mesh.faces)
    endoscope = Endoscope(CAMERA, RigidTransform.identity(), PROJECTOR, PROJECTOR_FROM_CAMERA)
    maps = truth_maps(scene, mesh, endoscope, coarse)
    depth = np.where(maps.visible, maps.depth, np.nan)
    padded = np.pad(depth, 1, mode="edge")
    around = [padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1]]
    step = np.any([~(np.abs(part - depth) < 1) for part in around], axis=0)
    assert np.array_equal(maps.mixed, maps.visible & step)


@pytest.mark.usefixtures("llvm")
def test_a_wall_lit_from_behind_is_not_visible():
    """Oracle: light on the far side of a sheet is not seen on the near side."""
    behind = RigidTransform.of(np.diag([-1.0, 1, -1]), [0, 0, 130.0])  # at z = 130, looking back
    mesh = rectangle(-80, 80, -70, 70, WALL)
    scene = MeshScene(mesh.vertices, mesh.faces)
    endoscope = Endoscope(CAMERA, RigidTransform.identity(), PROJECTOR, behind.inverse())
    maps = truth_maps(scene, mesh, endoscope, GRID)
    assert maps.camera.all()
    assert not maps.visible.any()
    assert maps.shadow.sum() > 100


@pytest.mark.usefixtures("llvm")
def test_smooth_normals_of_a_sphere_point_along_its_radius():
    """Oracle: the radius; the normals of flat faces would be up to 3 degrees off."""
    bowl = ConcaveSphere(distance=60, radius=50, edge=3.5, angle_x=1.2, angle_y=1.2)
    maps = maps_of(bowl.mesh(), RigidTransform.identity())
    rays = CAMERA.rays(CAMERA.pixel_grid())
    points = rays * (maps.depth / rays[..., 2])[..., None]
    radius = bowl.centre - points
    radius /= np.linalg.norm(radius, axis=-1, keepdims=True)
    off = np.degrees(np.arccos((maps.normals * radius).sum(-1)[5:-5, 5:-5].clip(-1, 1)))
    assert off.max() < 0.3


@pytest.mark.usefixtures("llvm")
def test_a_polyps_truth_lies_on_its_surface():
    """Oracle: the cap's top is one height above the base, where a ray along the normal meets it."""
    polyp = Polyp(along=40.0, angle=1.0, diameter=8.0, height=3.0)
    colon = Colon(length=90, radius=20, fold_depth=4, polyps=(polyp,), edge=1.5, seed=2)
    (truth,) = colon.polyp_truth()
    mesh = colon.mesh()
    scene = MeshScene(mesh.vertices, mesh.faces)
    top = truth.base + truth.height * truth.normal
    met = scene.cast(top + 2 * truth.normal, -truth.normal[None])
    assert met.points[0] == pytest.approx(top, abs=0.05)


@pytest.mark.usefixtures("llvm")
def test_normals_at_a_crease_are_those_of_the_faces():
    """Oracle: two planes that share the vertices of their edge, at right angles."""
    vertices = np.array([[0.0, -60, 70], [0, 60, 70], [-70, 60, 0], [-70, -60, 0], [60, 60, 10],
                         [60, -60, 10]])  # fmt: skip
    mesh = Mesh(vertices, np.array([[3, 2, 0], [0, 2, 1], [0, 1, 5], [5, 1, 4]]))
    maps = maps_of(mesh, RigidTransform.identity())
    left, right = np.array([1.0, 0, -1]) / np.sqrt(2), np.array([-1.0, 0, -1]) / np.sqrt(2)
    nearest = np.minimum(np.abs(maps.normals - left).max(-1), np.abs(maps.normals - right).max(-1))
    assert maps.camera.all()
    assert nearest.max() < 1e-6
    assert (maps.normals[:, 0] @ left > 0.99).all()
    assert (maps.normals[:, -1] @ right > 0.99).all()
