import numpy as np
import pytest

from mitsuba_endo.dataset.config import Config, PoseRules
from mitsuba_endo.dataset.optics import draw_camera, draw_projector, draw_projector_pose
from mitsuba_endo.dataset.pose_sampler import PoseSampler, clearance
from mitsuba_endo.dataset.scene_ranges import ViewRanges
from mitsuba_endo.dataset.view_sampler import LumenViews, MeshViews, SheetViews
from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.synthetic import MeshScene
from mitsuba_endo.shapes import Mesh, make_shape
from mitsuba_endo.shapes.colon import Colon

PATTERN = (480, 384)
VIEW, RULES = ViewRanges(), PoseRules()


def sample(mesh: Mesh, views, view: ViewRanges = VIEW, rules: PoseRules = RULES, seed: int = 1):
    config, rng = Config(), np.random.default_rng(seed)
    camera = draw_camera(config.camera, rng)
    projector = draw_projector(config.projector, PATTERN, rng)
    scene = MeshScene(mesh.vertices, mesh.faces)
    sampler = PoseSampler(rules, mesh, scene, camera, projector, PATTERN)
    return sampler.sample(views, view, config.projector, rng)


def test_clearance_is_the_distance_to_the_nearest_face_not_vertex():
    """Oracle: the distance of a point from a plane far from its corners, and from an edge."""
    vertices = np.array([[-50.0, -50, 7], [50, -50, 7], [50, 50, 7], [-50, 50, 7]])
    mesh = Mesh(vertices, np.array([[0, 3, 1], [1, 3, 2]]))
    assert clearance(mesh, np.array([3.0, -4.0, 4.0]), 5.0) == pytest.approx(3.0)
    assert clearance(mesh, np.array([53.0, 2.0, 3.0]), 6.0) == pytest.approx(5.0)
    assert clearance(mesh, np.array([0.0, 0.0, 0.0]), 5.0) == np.inf


@pytest.mark.usefixtures("llvm")
def test_poses_in_a_lumen_keep_their_distance_and_are_lit():
    """Oracle: the distance to the nearest of many points of the wall, camera and projector."""
    colon = Colon(length=90, radius=18, fold_depth=6, edge=1.5, seed=3)
    mesh = colon.mesh()
    rules = PoseRules(margin=3.0, least_lit=0.2)
    for seed in range(4):
        poses = sample(mesh, LumenViews(colon, 20.0), rules=rules, seed=seed)
        middles = mesh.vertices[mesh.faces].mean(1)
        projector = poses.endoscope.world_from_projector.t
        for point in (poses.endoscope.world_from_camera.t, projector):
            assert np.linalg.norm(middles - point, axis=1).min() > 3.0
            assert 0 < point[2] < 90  # in the tube, not behind or beyond it
        assert poses.lit >= 0.2


@pytest.mark.usefixtures("llvm")
def test_a_camera_inside_the_wall_is_refused_with_the_reason():
    """Oracle: a views that always stands in a closed solid, 10 mm from its surface."""
    import trimesh

    solid = trimesh.creation.icosphere(3, 30.0)

    class InTheMiddle:
        def draw(self, view, rng, scene):
            return RigidTransform.of([0, 0, 0.2], [4.0, -3.0, 2.0])

    mesh = Mesh(np.array(solid.vertices), np.array(solid.faces))
    with pytest.raises(InputError, match="5 with the camera behind or inside the surface"):
        sample(mesh, InTheMiddle(), rules=PoseRules(tries=5))


@pytest.mark.usefixtures("llvm")
def test_views_without_light_or_room_are_given_up_with_counts():
    """Oracle: a sheet nearer than the margin; a small one in a wide view."""
    near = make_shape("plane", distance=3.0, edge=5)
    with pytest.raises(InputError, match=r"4 tries \(4 with the camera nearer than 5 mm"):
        sample(
            near,
            SheetViews(3.0),
            ViewRanges.model_validate({"tilt": 0}),
            PoseRules(margin=5, tries=4),
        )
    small = make_shape("plane", distance=60.0, width=4, height=4, edge=1)
    with pytest.raises(InputError, match="6 with less than 15 % of the image lit"):
        sample(small, SheetViews(60.0), rules=PoseRules(tries=6))


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("side", ["outside", "inside"])
def test_a_ball_is_seen_from_its_side(side):
    """Oracle: the camera's distance from the ball's centre."""
    import trimesh

    ball = trimesh.creation.icosphere(4, 40.0)
    faces = np.array(ball.faces) if side == "outside" else np.array(ball.faces)[:, ::-1]
    mesh = Mesh(np.array(ball.vertices), faces)
    poses = sample(mesh, MeshViews(mesh, side), ViewRanges.model_validate({"distance": [25, 35]}))
    away = np.linalg.norm(poses.endoscope.world_from_camera.t)
    assert (away > 42) if side == "outside" else (away < 38)


def test_the_projector_stands_in_its_channel():
    """Oracle: the drawn baseline, and an axis that meets the camera's where it should."""
    data = {"baseline": 6, "ahead": 2, "meeting": 50, "tilt": 0, "bearing": 30, "roll": [-90, 90]}
    ranges = Config.model_validate({"projector": data}).projector
    camera_from_projector = draw_projector_pose(ranges, np.random.default_rng(4)).inverse()
    centre = camera_from_projector.t
    assert centre == pytest.approx([6 * np.cos(np.pi / 6), 3.0, 2.0])
    axis = camera_from_projector.R[:, 2]
    assert centre + axis * np.hypot(6, 50) == pytest.approx([0, 0, 52.0])


def test_a_lens_that_folds_the_image_is_refused():
    """Oracle: k1 = -1 at the corner of a wide view, where the distorted radius shrinks again."""
    ranges = Config.model_validate({"camera": {"fov": 100, "distortion": [-1.0, 0.0]}}).camera
    with pytest.raises(InputError, match=r"camera\.distortion: folds the image"):
        draw_camera(ranges, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("model", "distortion"),
    [("opencv", [0.0] * 4), ("opencv_fisheye", [0.0] * 4), ("omni", [0.8, 0, 0, 0, 0]),
     ("double_sphere", [-0.2, 0.57]), ("scaramuzza", [0, -0.4, 0.05, -0.05])],
)  # fmt: skip
def test_every_camera_model_has_the_drawn_field_of_view(model, distortion):
    """Oracle: the angle between the rays of the left and right edges of the middle row."""
    keys = {"model": model, "fov": 110, "distortion": distortion, "centre": 0, "aspect": 1}
    ranges = Config.model_validate({"camera": keys}).camera
    camera = draw_camera(ranges, np.random.default_rng(0))
    middle = (camera.height - 1) / 2
    left, right = camera.rays(np.array([[-0.5, middle], [camera.width - 0.5, middle]]))
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(110, abs=1e-6)
