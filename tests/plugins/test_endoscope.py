"""The sensor endoscope: rays, light tracing, agreement with ``perspective``."""

import cv2
import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from tests.plugins import scenes

MODELS = list(scenes.LENSES)


def model(name: str) -> CameraModel:
    c = scenes.CAMERA
    K = np.array([[c["fx"], 0, c["cx"]], [0, c["fy"], c["cy"]], [0, 0, 1]])
    return CameraModel(name, scenes.WIDTH, scenes.HEIGHT, K, tuple(scenes.LENSES[name].values()))


def film_positions(pixels: np.ndarray):
    import mitsuba as mi

    fractions = (pixels + 0.5) / [scenes.WIDTH, scenes.HEIGHT]
    return mi.Point2f(fractions.reshape(-1, 2).T.astype(np.float32))


@pytest.mark.parametrize("name", MODELS)
def test_rays_are_the_camera_models(name: str, llvm: str) -> None:
    """Oracle: CameraModel.rays (tested against OpenCV) turned into the world by NumPy."""
    import mitsuba as mi

    camera = mi.load_dict(scenes.camera(name))
    pixels = model(name).pixel_grid() + np.array([0.25, -0.125])
    for method in (camera.sample_ray, camera.sample_ray_differential):
        ray, weight = method(0.0, 0.5, film_positions(pixels), mi.Point2f(0.5))
        expected = scenes.WORLD_FROM_CAMERA.rotate(model(name).rays(pixels)).reshape(-1, 3)
        np.testing.assert_allclose(ray.d.numpy().T, expected, atol=1e-6)
        assert (weight.numpy() == 1).all()
        origin = scenes.WORLD_FROM_CAMERA.t + 0.01 * expected  # default near_clip
        np.testing.assert_allclose(ray.o.numpy().T, origin, atol=1e-6)


@pytest.mark.parametrize("name", ["opencv", "opencv_fisheye"])
def test_rays_meet_opencvs_projection(name: str, llvm: str) -> None:
    """Oracle: cv2.projectPoints or cv2.fisheye.projectPoints of points along the rays."""
    import mitsuba as mi

    camera = mi.load_dict(scenes.camera(name))
    pixels = model(name).pixel_grid().reshape(-1, 2)
    ray, _ = camera.sample_ray(0.0, 0.5, film_positions(pixels), mi.Point2f(0.5))
    local = scenes.WORLD_FROM_CAMERA.inverse().rotate(ray.d.numpy().T.astype(float))
    project = cv2.fisheye.projectPoints if name == "opencv_fisheye" else cv2.projectPoints
    coefficients = np.array(model(name).distortion)
    got, _ = project(local[:, None], np.zeros(3), np.zeros(3), model(name).K, coefficients)
    np.testing.assert_allclose(got[:, 0], pixels, atol=1e-4)  # px, of single-precision rays


@pytest.mark.parametrize("name", MODELS)
def test_rays_are_the_cameras(name: str, llvm: str) -> None:
    """Oracle: the camera model, whose formulas tests/geometry compares with their papers."""
    import mitsuba as mi

    pixels = model(name).pixel_grid().reshape(-1, 2)
    ray, _ = mi.load_dict(scenes.camera(name)).sample_ray(
        0.0, 0.5, film_positions(pixels), mi.Point2f(0.5)
    )
    local = scenes.WORLD_FROM_CAMERA.inverse().rotate(ray.d.numpy().T.astype(float))
    np.testing.assert_allclose(local, model(name).rays(pixels), atol=1e-6)  # single precision


@pytest.mark.parametrize("name", MODELS)
def test_ray_differentials_are_the_neighbours(name: str, llvm: str) -> None:
    """Oracle: the ray of the next pixel to the right, and of the one below."""
    import mitsuba as mi

    camera = mi.load_dict(scenes.camera(name))
    pixels = model(name).pixel_grid().reshape(-1, 2)
    ray, _ = camera.sample_ray_differential(0.0, 0.5, film_positions(pixels), mi.Point2f(0.5))
    rotate = scenes.WORLD_FROM_CAMERA.rotate
    right, below = (rotate(model(name).rays(pixels + step)) for step in ([1, 0], [0, 1]))
    np.testing.assert_allclose(ray.d_x.numpy().T, right, atol=2e-6)
    np.testing.assert_allclose(ray.d_y.numpy().T, below, atol=2e-6)


def test_crop_window_is_a_part_of_the_calibrated_image(llvm: str) -> None:
    """Oracle: the same pixels of the full image's rays."""
    import mitsuba as mi

    crop = {"crop_offset_x": 7, "crop_offset_y": 4, "crop_width": 12, "crop_height": 9}
    camera = mi.load_dict(scenes.camera(film=scenes.film(**crop)))
    corner = mi.Point2f((0.5 + 3) / 12, (0.5 + 2) / 9)
    ray, _ = camera.sample_ray(0.0, 0.5, corner, mi.Point2f(0.5))
    expected = scenes.WORLD_FROM_CAMERA.rotate(model("opencv").rays(np.array([10.0, 6.0])))
    np.testing.assert_allclose(ray.d.numpy()[:, 0], expected, atol=1e-6)


def test_undistorted_is_mitsubas_perspective(llvm: str) -> None:
    """Oracle: the image of ``perspective`` with the same field of view and principal point."""
    import mitsuba as mi

    fov, offset = 65.0, (0.08, -0.05)
    fx = scenes.WIDTH / (2 * np.tan(np.radians(fov / 2)))
    cx = (scenes.WIDTH - 1) / 2 - offset[0] * scenes.WIDTH
    cy = (scenes.HEIGHT - 1) / 2 - offset[1] * scenes.HEIGHT
    pose = scenes.to_world(scenes.WORLD_FROM_CAMERA)
    theirs = {
        "type": "perspective", "fov": fov, "principal_point_offset_x": offset[0],
        "principal_point_offset_y": offset[1], "to_world": pose, "film": scenes.film(),
    }  # fmt: skip
    ours = {
        "type": "endoscope", "fx": fx, "cx": cx, "cy": cy, "to_world": pose,
        "film": scenes.film(),
    }  # fmt: skip
    images = []
    for camera in (theirs, ours):
        scene = mi.load_dict(
            {"type": "scene", "camera": camera, "surface": scenes.triangles(*scenes.bumpy_grid()),
             "light": {"type": "point", "position": [2.0, -1, 0], "intensity": 90.0}}
        )  # fmt: skip
        images.append(
            np.array(mi.render(scene, spp=64, seed=3, integrator=mi.load_dict({"type": "direct"})))
        )
    assert images[0].std() > 0.01
    # Silhouettes and facet edges move by rounding only; the sampler is the same.
    assert np.abs(images[0] - images[1]).max() < 1e-3 * images[0].max()


@pytest.mark.parametrize("name", MODELS)
def test_light_tracing_sees_the_same_image(name: str, llvm: str) -> None:
    """Oracle: path tracing from the camera; ptracer connects light paths by sample_direction."""
    import mitsuba as mi

    light = {"type": "point", "position": [2.0, -1, 0], "intensity": 90.0}
    scene = mi.load_dict(
        {"type": "scene", "camera": scenes.camera(name), "light": light,
         "surface": scenes.triangles(*scenes.bumpy_grid())}
    )  # fmt: skip
    images = []
    for integrator, spp in (("path", 64), ("ptracer", 8000)):
        images.append(
            np.array(
                mi.render(
                    scene,
                    integrator=mi.load_dict({"type": integrator, "max_depth": 2}),
                    spp=spp,
                )
            )[2:-2, 2:-2]
        )
    blocks = [i[:24, :40].reshape(6, 4, 10, 4, 3).mean((1, 3, 4)) for i in images]
    np.testing.assert_allclose(blocks[1], blocks[0], rtol=0.06)  # Monte Carlo error 1.5 %


@pytest.mark.parametrize("name", MODELS)
def test_projecting_a_rays_point_gives_its_film_position(name: str, llvm: str) -> None:
    """sample_direction inverts sample_ray; beyond the film the importance is zero."""
    import drjit as dr
    import mitsuba as mi

    camera = mi.load_dict(scenes.camera(name))
    pixels = model(name).pixel_grid().reshape(-1, 2)
    it = dr.zeros(mi.SurfaceInteraction3f)
    points = scenes.WORLD_FROM_CAMERA.apply(model(name).rays(pixels) * 8)
    it.p = mi.Point3f(points.T.astype(np.float32))
    ds, weight = camera.sample_direction(it, mi.Point2f(0.5))
    np.testing.assert_allclose(ds.uv.numpy().T, pixels + 0.5, atol=1e-3)
    assert (weight.numpy() > 0).all()
    it.p = mi.Point3f(scenes.WORLD_FROM_CAMERA.apply(np.array([0.1, 0.2, -8.0])).tolist())
    _, weight = camera.sample_direction(it, mi.Point2f(0.5))
    assert (weight.numpy() == 0).all()


@pytest.mark.parametrize("name", MODELS)
def test_rays_in_every_variant(name: str, any_variant: str) -> None:
    """Oracle: CameraModel.rays, in a colour, a monochrome and a scalar variant."""
    import mitsuba as mi

    camera = mi.load_dict(scenes.camera(name))
    pixel = np.array([5.0, 21.0])
    fraction = (pixel + 0.5) / [scenes.WIDTH, scenes.HEIGHT]
    ray, _ = camera.sample_ray_differential(
        0.0, 0.5, mi.Point2f(fraction.tolist()), mi.Point2f(0.5)
    )
    expected = scenes.WORLD_FROM_CAMERA.rotate(model(name).rays(pixel))
    np.testing.assert_allclose(np.array(ray.d).ravel(), expected, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"lens": "pinhole"}, "lens"),
        ({"near_clip": 5.0, "far_clip": 1.0}, "near_clip"),
        ({"fxx": 1.0}, "fxx"),
        ({"fx": 0.0}, '"fx" must be a finite number above 0, got 0'),
        ({"fy": -34.5}, '"fy"'),
        ({"fx": float("nan")}, '"fx"'),
        ({"fy": float("inf")}, '"fy"'),
        ({"cx": float("nan")}, '"cx" must be a finite number, got nan'),
        ({"cy": float("inf")}, '"cy"'),
        ({"k1": float("nan")}, '"k1"'),
        ({"film": scenes.film(width=0)}, "film are 0 and 30 pixels"),
        ({"film": scenes.film(height=0)}, "film are 44 and 0 pixels"),
    ],
)
def test_wrong_parameters_are_named(changes: dict, named: str, llvm: str) -> None:
    """Loading fails with the parameter's name in the message."""
    import mitsuba as mi

    with pytest.raises(RuntimeError, match=named):
        mi.load_dict(scenes.camera(**changes))


def test_unknown_model_is_named(llvm: str) -> None:
    """Loading fails and lists the models there are."""
    import mitsuba as mi

    with pytest.raises(RuntimeError, match="opencv_fisheye"):
        mi.load_dict({"type": "endoscope", "model": "pinhole", "fx": 30.0})
