"""The integrator projector_coords against analytic geometry and finite differences."""

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import PROJECTION_MODELS, projector_model
from tests.plugins import scenes

MODELS = list(scenes.LENSES)


def rays(model: str) -> np.ndarray:
    """Return world directions (H, W, 3) of the pixel centres, by NumPy."""
    c = scenes.CAMERA
    K = np.array([[c["fx"], 0, c["cx"]], [0, c["fy"], c["cy"]], [0, 0, 1]])
    lens = tuple(scenes.LENSES[model].values())
    camera = CameraModel(model, scenes.WIDTH, scenes.HEIGHT, K, lens)
    return scenes.WORLD_FROM_CAMERA.rotate(camera.rays(camera.pixel_grid()))


def project(law: str, points: np.ndarray) -> np.ndarray:
    p = scenes.PROJECTOR
    distortion = tuple(p[k] for k in ("k1", "k2", "p1", "p2", "k3"))
    model = projector_model(
        law, p["focal"], (p["centre_x"], p["centre_y"]), p["aspect"], distortion
    )
    return model.project(scenes.WORLD_FROM_PROJECTOR.inverse().apply(points))


def load(law: str, model: str, shapes: dict):
    import mitsuba as mi

    parts = {"camera": scenes.camera(model), "projector": scenes.projector(law)}
    return mi.load_dict({"type": "scene", **parts, **shapes})


def coordinates(scene, **settings: object) -> np.ndarray:
    import mitsuba as mi

    integrator = mi.load_dict({"type": "projector_coords", **settings})
    return mi.render(scene, integrator=integrator).numpy().astype(float)


def check_against(image: np.ndarray, law: str, points: np.ndarray) -> None:
    """Compare an image with the coordinates, depths and camera mask of analytic points (NaN)."""
    hit = np.isfinite(points[..., 0])
    q = project(law, points)
    depth = scenes.WORLD_FROM_CAMERA.inverse().apply(points)[..., 2]
    sure = hit == (image[..., 4] == 1)
    assert sure.mean() > 0.995  # silhouette pixels may fall either way in single precision
    assert np.nanmax(np.abs(image[..., :2] - q)[sure]) < 1e-3
    assert np.nanmax(np.abs(image[..., 2] - depth)[sure]) < 1e-3
    assert np.isnan(image[..., :3][image[..., 4] == 0]).all()
    assert np.isfinite(image[..., :3][image[..., 4] == 1]).all()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_plane(law: str, model: str, ad_variant: str) -> None:
    """Oracle: ray-plane intersection and projection in NumPy."""
    mesh, n, d = scenes.tilted_plane()
    image = coordinates(load(law, model, {"surface": mesh}))
    assert image.shape == (scenes.HEIGHT, scenes.WIDTH, 5)
    origin, directions = scenes.WORLD_FROM_CAMERA.t, rays(model)
    t = (d - origin @ n) / (directions @ n)
    check_against(image, law, origin + t[..., None] * directions)
    q = image[..., :2]
    size = [scenes.PATTERN_WIDTH, scenes.PATTERN_HEIGHT]
    inside = ((q >= -0.5) & (q <= np.array(size) - 0.5)).all(-1)
    assert 0.1 < inside.mean() < 0.95
    np.testing.assert_array_equal(image[..., 3] == 1, inside)  # nothing occludes a plane


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_sphere(law: str, model: str, ad_variant: str) -> None:
    """Oracle: ray-sphere intersection; a part of the view misses it."""
    centre, radius = np.array([0.8, -0.5, 9.0]), 3.5
    sphere = {"type": "sphere", "center": centre.tolist(), "radius": radius}
    image = coordinates(load(law, model, {"surface": sphere}))
    directions = rays(model)
    o = scenes.WORLD_FROM_CAMERA.t - centre
    b = directions @ o
    disc = b * b - (o @ o - radius**2)
    t = np.where(disc > 0, -b - np.sqrt(np.maximum(disc, 0)), np.nan)
    points = scenes.WORLD_FROM_CAMERA.t + t[..., None] * directions
    assert 0.05 < np.isnan(t).mean() < 0.95
    check_against(image, law, points)


def test_visible_is_not_in_the_occluders_shadow(llvm: str) -> None:
    """Oracle: a sphere's shadow on a plane, by the distance of its centre from each light ray."""
    mesh, n, d = scenes.tilted_plane()
    centre, radius = np.array([-0.4, 0.3, 5.0]), 0.6
    sphere = {"type": "sphere", "center": centre.tolist(), "radius": radius}
    image = coordinates(load("pinhole", "opencv", {"surface": mesh, "occluder": sphere}))
    origin, directions = scenes.WORLD_FROM_CAMERA.t, rays("opencv")
    t = (d - origin @ n) / (directions @ n)
    points = origin + t[..., None] * directions
    on_plane = (
        np.abs(image[..., 2] - scenes.WORLD_FROM_CAMERA.inverse().apply(points)[..., 2]) < 1e-3
    )
    light = points - scenes.WORLD_FROM_PROJECTOR.t
    light /= np.linalg.norm(light, axis=-1, keepdims=True)
    to_centre = centre - scenes.WORLD_FROM_PROJECTOR.t
    distance = np.linalg.norm(np.cross(light, to_centre), axis=-1)
    sure = on_plane & (np.abs(distance - radius) > 1e-3)
    q = project("pinhole", points)
    size = [scenes.PATTERN_WIDTH, scenes.PATTERN_HEIGHT]
    inside = ((q >= -0.5) & (q <= np.array(size) - 0.5)).all(-1)
    expected = inside & (distance > radius)
    assert (inside & ~expected & sure).sum() > 20  # there is a shadow on the pattern
    assert (~on_plane).sum() > 20  # and the camera sees the occluder itself
    np.testing.assert_array_equal((image[..., 3] == 1)[sure], expected[sure])
    assert np.isfinite(image[..., 0][on_plane]).all()  # shadowed points keep their coordinates


def test_far_side_of_a_thin_surface_is_not_visible(llvm: str) -> None:
    """Camera and projector on opposite sides of a plane: nothing the camera sees is lit."""
    mesh, _, _ = scenes.tilted_plane()
    import mitsuba as mi

    behind = mi.ScalarTransform4f().look_at([0.5, 0.2, 20.0], [0.0, 0.0, 9.0], [0.0, 1.0, 0.0])
    parts = {"camera": scenes.camera(), "projector": scenes.projector(to_world=behind)}
    scene = mi.load_dict({"type": "scene", "surface": mesh, **parts})
    image = coordinates(scene)
    assert (image[..., 4] == 1).all()
    assert np.isfinite(image[..., 0]).all()
    assert (image[..., 3] == 0).all()


def test_behind_the_projector_is_missing(llvm: str) -> None:
    """A projector that looks away from the plane gives NaN coordinates but depth."""
    mesh, _, _ = scenes.tilted_plane()
    import mitsuba as mi

    away = mi.ScalarTransform4f().look_at([0.5, 0.2, 0.0], [0.0, 0.0, -9.0], [0.0, 1.0, 0.0])
    parts = {"camera": scenes.camera(), "projector": scenes.projector(to_world=away)}
    image = coordinates(mi.load_dict({"type": "scene", "surface": mesh, **parts}))
    assert np.isnan(image[..., :2]).all()
    assert np.isfinite(image[..., 2]).all()


def test_mitsubas_perspective_sensor_works_too(llvm: str) -> None:
    """Oracle: ray-plane intersection with the rays of a pinhole of 50 degrees."""
    mesh, n, d = scenes.tilted_plane()
    import mitsuba as mi

    pose = scenes.to_world(scenes.WORLD_FROM_CAMERA)
    camera = {"type": "perspective", "fov": 50, "to_world": pose, "film": scenes.film()}
    parts = {"camera": camera, "projector": scenes.projector()}
    image = coordinates(mi.load_dict({"type": "scene", "surface": mesh, **parts}))
    f = scenes.WIDTH / (2 * np.tan(np.radians(25)))
    x, y = np.meshgrid(np.arange(scenes.WIDTH), np.arange(scenes.HEIGHT))
    local = np.stack([(x - 21.5) / f, (y - 14.5) / f, np.ones_like(x)], -1)
    directions = scenes.WORLD_FROM_CAMERA.rotate(local)
    t = (d - scenes.WORLD_FROM_CAMERA.t @ n) / (directions @ n)
    check_against(image, "pinhole", scenes.WORLD_FROM_CAMERA.t + t[..., None] * directions)


def test_projector_is_found_by_id(llvm: str) -> None:
    """With two projectors an id is needed, and a wrong one is answered with those there are."""
    mesh, _, _ = scenes.tilted_plane()
    scene = load("pinhole", "opencv", {"surface": mesh, "second": scenes.projector(centre_x=3.0)})
    assert np.nanmax(np.abs(coordinates(scene, projector="second")
                            - coordinates(scene, projector="projector"))) > 15  # fmt: skip
    for settings in ({}, {"projector": "third"}):
        with pytest.raises((InputError, RuntimeError)) as caught:
            coordinates(scene, **settings)
        assert "second" in str(caught.value.__cause__ or caught.value)


PARAMETERS = [*scenes.PROJECTOR]
POSES = ["camera.to_world", "projector.to_world"]


def smooth_loss(image, weights: np.ndarray):
    """Return a weighted sum of x, y and depth over the pixels that see something."""
    import drjit as dr
    import mitsuba as mi

    flat = image.array
    known = dr.isfinite(flat)
    return dr.sum(dr.select(known, flat, 0.0) * mi.Float(weights.astype(np.float32).ravel()))


def derivative_scene(law: str):
    """Return a scene whose sheet fills the view, and weights over pixels away from mesh edges.

    A pixel whose ray crosses an edge within the finite step is not differentiable; a weight of
    zero for those within 3 % of a triangle's edge keeps the oracle valid.
    """
    import drjit as dr
    import mitsuba as mi

    vertices, faces = scenes.bumpy_grid()
    scene = load(law, "opencv", {"surface": scenes.triangles(vertices, faces)})
    camera = scene.sensors()[0]
    x, y = np.meshgrid(np.arange(scenes.WIDTH), np.arange(scenes.HEIGHT))
    fractions = (np.stack([x, y], -1).reshape(-1, 2) + 0.5) / [scenes.WIDTH, scenes.HEIGHT]
    ray, _ = camera.sample_ray(0, 0.5, mi.Point2f(fractions.T.astype(np.float32)), mi.Point2f(0.5))
    uv = scene.ray_intersect_preliminary(ray).prim_uv.numpy()
    dr.eval()
    inner = (uv.min(0) > 0.03) & (uv.sum(0) < 0.97)
    assert inner.mean() > 0.6
    weights = np.random.default_rng(0).uniform(0.2, 1, (scenes.HEIGHT * scenes.WIDTH, 5))
    weights[:, 1] *= -0.8  # derivatives of x and y must not be interchangeable
    weights[:, 3:] = 0
    return scene, weights * inner[:, None]


def check_derivative(scene, weights: np.ndarray, set_value, step: float) -> None:
    """Compare reverse and forward mode with Richardson-extrapolated central differences.

    ``set_value(params, x)`` applies the scalar x (a float or a Dr.Jit value), 0 = as loaded.
    Relative tolerance 1e-3: the oracle is single precision.
    """
    import drjit as dr
    import mitsuba as mi

    integrator = mi.load_dict({"type": "projector_coords"})
    params = mi.traverse(scene)

    def image(value: object) -> object:
        set_value(params, value)
        params.update()
        return mi.render(scene, params, integrator=integrator)

    def plain(value: float) -> float:
        values = image(mi.Float(value)).numpy().astype(float).ravel()
        return float(np.nansum(values * weights.ravel()))

    coarse = (plain(2 * step) - plain(-2 * step)) / (4 * step)
    fine = (plain(step) - plain(-step)) / (2 * step)
    expected = (4 * fine - coarse) / 3

    value = mi.Float(0.0)
    dr.enable_grad(value)
    dr.backward(smooth_loss(image(value), weights))
    backward = dr.grad(value)[0]

    value = mi.Float(0.0)
    dr.enable_grad(value)
    result = image(value)
    dr.set_grad(value, 1.0)
    tangent = dr.forward_to(result, flags=dr.ADFlag.Default).numpy().ravel()
    forward = float(np.nansum(tangent.astype(float) * weights.ravel()))
    assert abs(expected) > 1
    assert backward == pytest.approx(expected, rel=1e-3)
    assert forward == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", PARAMETERS)
@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_derivatives_of_intrinsics(law: str, name: str, llvm: str) -> None:
    """Oracle: central finite differences of the rendered image."""
    import mitsuba as mi

    scene, weights = derivative_scene(law)
    start = float(mi.traverse(scene)[f"projector.{name}"][0])

    def set_value(params, x) -> None:
        params[f"projector.{name}"] = start + x

    check_derivative(scene, weights, set_value, step=0.02 * max(1.0, abs(start) / 10))


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("key", POSES)
@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_derivatives_of_poses(law: str, key: str, axis: int, llvm: str) -> None:
    """Oracle: central finite differences; rotation about, and translation along, each axis."""
    import mitsuba as mi

    scene, weights = derivative_scene(law)
    start = mi.AffineTransform4f(mi.traverse(scene)[key])
    unit = np.eye(3)[axis % 3].tolist()

    def set_value(params, x) -> None:
        if axis < 3:
            move = mi.Transform4f().rotate(unit, x * 180 / np.pi)
        else:
            move = mi.Transform4f().translate(x * mi.Vector3f(unit))
        params[key] = mi.AffineTransform4f(start @ mi.AffineTransform4f(move))

    # The camera's rays must stay inside their triangles; the projector's step has no such limit.
    step = 2e-3 if key == "camera.to_world" else 8e-3
    check_derivative(scene, weights, set_value, step * (1 if axis < 3 else 4))


@pytest.mark.parametrize("direction", [(0, 0, 1.0), (0.6, -0.3, 0.2)])
@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_derivatives_of_vertices(law: str, direction: tuple, llvm: str) -> None:
    """Oracle: central finite differences along a random displacement of all vertices."""
    import mitsuba as mi

    scene, weights = derivative_scene(law)
    key = "surface.vertex_positions"
    start = mi.traverse(scene)[key].numpy().reshape(-1, 3)
    amount = np.random.default_rng(5).uniform(0.5, 1.5, (len(start), 1))
    move = mi.Float((amount * direction).astype(np.float32).ravel())

    def set_value(params, x) -> None:
        params[key] = mi.Float(start.ravel()) + move * x

    check_derivative(scene, weights, set_value, step=1.5e-2)


def test_missing_pixels_leave_derivatives_finite(llvm: str) -> None:
    """Pixels without a surface, and a projector that leaves points behind it, give no NaN."""
    import drjit as dr
    import mitsuba as mi

    vertices, faces = scenes.bumpy_grid()
    mesh = scenes.triangles(vertices * [0.3, 0.3, 1], faces)
    scene = load("direction_cosine", "opencv", {"surface": mesh})
    integrator = mi.load_dict({"type": "projector_coords"})
    params = mi.traverse(scene)
    params.keep(["surface.vertex_positions", "projector.focal", "projector.k1",
                 "projector.to_world", "camera.to_world", "camera.k1"])  # fmt: skip
    for key in params.keys():  # noqa: SIM118 (SceneParameters iterates over pairs)
        dr.enable_grad(params[key])
    params.update()
    image = mi.render(scene, params, integrator=integrator)
    assert np.isnan(image.numpy()).any()
    dr.backward(smooth_loss(image, np.ones((scenes.HEIGHT * scenes.WIDTH, 5))))
    for key in ("surface.vertex_positions", "projector.focal", "projector.k1", "camera.k1"):
        gradient = dr.grad(params[key]).numpy()
        assert np.isfinite(gradient).all(), key
        assert np.abs(gradient).max() > 0, key
    for key in ("projector.to_world", "camera.to_world"):
        gradient = dr.grad(params[key].matrix).numpy()
        assert np.isfinite(gradient).all(), key


@pytest.mark.parametrize(
    ("name", "step"),
    [("fx", 0.06), ("fy", 0.06), ("cx", 0.05), ("cy", 0.05), ("k1", 4e-3), ("p2", 2e-3)],
)
def test_derivatives_of_the_camera(name: str, step: float, llvm: str) -> None:
    """Oracle: central finite differences; the rays move, so steps keep them in their triangles."""
    import mitsuba as mi

    scene, weights = derivative_scene("direction_cosine")
    start = float(mi.traverse(scene)[f"camera.{name}"][0])

    def set_value(params, x) -> None:
        params[f"camera.{name}"] = start + x

    check_derivative(scene, weights, set_value, step)
