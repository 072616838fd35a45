"""The emitter doe_projector: energy, sampling, orientation, and agreement with ``projector``."""

import numpy as np
import pytest

from mitsuba_endo.geometry.projection_models import PROJECTION_MODELS, projector_model
from tests.plugins import scenes


def load(law: str = "pinhole", **changes: object):
    import mitsuba as mi

    emitter = mi.load_dict(scenes.projector(law, **changes))
    return emitter


def model(law: str):
    p = scenes.PROJECTOR
    distortion = tuple(p[k] for k in ("k1", "k2", "p1", "p2", "k3"))
    return projector_model(law, p["focal"], (p["centre_x"], p["centre_y"]), p["aspect"], distortion)


def world_points(law: str, q: np.ndarray, distance: float = 7.0) -> np.ndarray:
    return scenes.WORLD_FROM_PROJECTOR.apply(model(law).unproject(q) * distance)


def pattern_coordinates(count: int = 400, margin: float = -0.5) -> np.ndarray:
    high = [scenes.PATTERN_WIDTH - 1 - margin, scenes.PATTERN_HEIGHT - 1 - margin]
    return np.random.default_rng(7).uniform([margin, margin], high, (count, 2))


def incident(emitter, points: np.ndarray):
    """Return what sample_direction says at points (N, 3): record and weight (N, 3)."""
    import drjit as dr
    import mitsuba as mi

    it = dr.zeros(mi.SurfaceInteraction3f)
    it.p = mi.Point3f(points.T.astype(np.float32))
    ds, weight = emitter.sample_direction(it, mi.Point2f(0.5))
    assert np.array_equal(weight.numpy(), emitter.eval_direction(it, ds).numpy())
    return ds, weight.numpy().T


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_nearest_texel_of_an_integer_coordinate(law: str, llvm: str) -> None:
    """Oracle: I(q) = power T[y, x] / sum(T) |dq / d omega| at pixel centres, row 0 at q_y = 0."""
    pattern = scenes.random_pattern()
    emitter = load(law, pattern=scenes.bitmap(pattern), power=3.0)
    x, y = np.meshgrid(np.arange(scenes.PATTERN_WIDTH), np.arange(scenes.PATTERN_HEIGHT))
    q = np.stack([x, y], -1).reshape(-1, 2).astype(float)
    ds, weight = incident(emitter, world_points(law, q, distance=7.0))
    luminance = pattern @ [0.212671, 0.715160, 0.072169]
    density = model(law).density_xyz(*model(law).unproject(q).T)
    expected = 3 * pattern.reshape(-1, 3) / luminance.sum() * density[:, None] / 7**2
    np.testing.assert_allclose(weight, expected, rtol=2e-4)
    np.testing.assert_allclose(ds.dist.numpy(), 7, rtol=1e-5)


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_power_is_what_leaves_the_projector(law: str, llvm: str) -> None:
    """Oracle: the integral of radiant intensity over the sphere by uniform sampling."""
    emitter = load(law, pattern=scenes.bitmap(scenes.random_pattern()[..., :1]), power=5.0)
    z, phi = np.random.default_rng(0).uniform([0.6, 0], [1, 2 * np.pi], (400_000, 2)).T
    r = np.sqrt(1 - z * z)
    directions = np.stack([r * np.cos(phi), r * np.sin(phi), z], -1)
    _, weight = incident(emitter, scenes.WORLD_FROM_PROJECTOR.apply(directions * 4.0))
    total = weight[:, 0].mean() * 4.0**2 * (2 * np.pi * 0.4)
    assert total == pytest.approx(5.0, rel=0.01)  # Monte Carlo error 0.3 %


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_sampled_rays_agree_with_evaluation(law: str, llvm: str) -> None:
    """Weighted rays and sample_direction are the same light: flux into a cone agrees.

    Oracle: integral of sample_direction over the cone's solid angle against the sum of the
    weights of the rays inside it.
    """
    import mitsuba as mi

    emitter = load(law, pattern=scenes.bitmap(scenes.random_pattern()), power=2.0)
    rng = np.random.default_rng(3)
    n = 400_000
    sample = mi.Point2f(rng.uniform(size=(2, n)).astype(np.float32))
    ray, weight = emitter.sample_ray(0.0, mi.Float(0.5), mi.Point2f(0.5), sample)
    axis = scenes.WORLD_FROM_PROJECTOR.R @ np.array([0.12, 0.08, 0.9890])
    axis /= np.linalg.norm(axis)
    cosine = np.cos(0.15)
    inside = ray.d.numpy().T @ axis > cosine
    traced = (weight.numpy().T * inside[:, None]).mean(0)
    np.testing.assert_allclose(ray.o.numpy()[:, 0], scenes.WORLD_FROM_PROJECTOR.t, atol=1e-6)

    c, phi = rng.uniform([cosine, 0], [1, 2 * np.pi], (n, 2)).T
    first = np.cross(axis, [1.0, 0, 0])
    first /= np.linalg.norm(first)
    s = np.sqrt(1 - c * c)[:, None]
    d = s * np.cos(phi)[:, None] * first + s * np.sin(phi)[:, None] * np.cross(axis, first)
    d += c[:, None] * axis
    _, value = incident(emitter, scenes.WORLD_FROM_PROJECTOR.t + d)
    evaluated = value.mean(0) * 2 * np.pi * (1 - cosine)
    np.testing.assert_allclose(traced, evaluated, rtol=0.02)  # Monte Carlo errors 0.5 %


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_sampled_rays_hit_the_projection_of_their_pixel(law: str, llvm: str) -> None:
    """A pattern with one lit texel sends all its rays through that texel's projection."""
    import mitsuba as mi

    pattern = np.zeros((scenes.PATTERN_HEIGHT, scenes.PATTERN_WIDTH, 1), np.float32)
    pattern[5, 31] = 1
    texture = scenes.bitmap(pattern) | {"filter_type": "nearest"}
    emitter = load(law, pattern=texture, power=2.0)
    sample = mi.Point2f(np.random.default_rng(0).uniform(size=(2, 500)).astype(np.float32))
    ray, weight = emitter.sample_ray(0.0, mi.Float(0.5), mi.Point2f(0.5), sample)
    q = model(law).project(scenes.WORLD_FROM_PROJECTOR.inverse().rotate(ray.d.numpy().T))
    assert np.abs(q - [31, 5]).max() < 0.5 + 1e-3
    np.testing.assert_allclose(weight.numpy(), 2.0, rtol=1e-4)


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_nothing_outside_the_pattern_or_behind(law: str, llvm: str) -> None:
    """Oracle: points made outside by more than half a pixel, and behind the projector."""
    emitter = load(law)
    w, h = scenes.PATTERN_WIDTH, scenes.PATTERN_HEIGHT
    edge = np.array([[-0.51, 5], [w - 0.49, 5], [11, -0.51], [11, h - 0.49]])
    inner = np.clip(edge, -0.49, [w - 0.51, h - 0.51])
    _, weight = incident(emitter, world_points(law, inner))
    assert (weight > 0).all()
    _, weight = incident(emitter, world_points(law, edge))
    assert (weight == 0).all()
    local = np.array([[0, 0, -3.0], [1, 2, 0.0], [0, 0, 0.0], [5, 1, 1e-9], [1e8, 0, 1.0]])
    _, weight = incident(emitter, scenes.WORLD_FROM_PROJECTOR.apply(local))
    assert (weight == 0).all()


def test_folded_directions_stay_dark(llvm: str) -> None:
    """With x (1 + k1 r^2), k1 = -0.5, r = 1.2 maps back into the pattern although it is folded."""
    changes = {"k1": -0.5, "k2": 0, "p1": 0, "p2": 0, "k3": 0}
    emitter = load("pinhole", **changes)
    local = np.array([[0.3, 0, 1.0], [1.2, 0, 1.0]]) * 5
    _, weight = incident(emitter, scenes.WORLD_FROM_PROJECTOR.apply(local))
    assert weight[0, 0] > 0
    assert weight[1, 0] == 0


def test_evanescent_pattern_pixels_send_no_ray(llvm: str) -> None:
    """With f = 10 px most of the 40 px pattern has direction cosines above 1: rays stay finite."""
    import mitsuba as mi

    none = dict.fromkeys(("k1", "k2", "p1", "p2", "k3"), 0.0)
    emitter = load("direction_cosine", focal=10.0, **none)
    sample = mi.Point2f(np.random.default_rng(0).uniform(size=(2, 4000)).astype(np.float32))
    ray, weight = emitter.sample_ray(0.0, mi.Float(0.5), mi.Point2f(0.5), sample)
    q = sample.numpy().T * [scenes.PATTERN_WIDTH, scenes.PATTERN_HEIGHT] - 0.5
    c = scenes.PROJECTOR
    r = np.hypot(q[:, 0] - c["centre_x"], (q[:, 1] - c["centre_y"]) / c["aspect"]) / 10
    emitted = weight.numpy()[0] > 0
    sure = abs(r - 1) > 0.01
    np.testing.assert_array_equal(emitted[sure], r[sure] < 1)
    assert np.isfinite(ray.d.numpy()).all()


def test_renders_like_mitsubas_projector(llvm: str) -> None:
    """Oracle: Mitsuba's ``projector`` with scale power f^2 / (pi sum T), 1e-5 of full scale."""
    import mitsuba as mi

    pattern = scenes.random_pattern()
    fov = 48.0
    focal = scenes.PATTERN_WIDTH / (2 * np.tan(np.radians(fov / 2)))
    pose = scenes.to_world(scenes.WORLD_FROM_PROJECTOR)
    luminance = float((pattern @ [0.212671, 0.715160, 0.072169]).sum())
    theirs = {
        "type": "projector", "irradiance": scenes.bitmap(pattern), "fov": fov,
        "to_world": pose, "scale": 40 * focal**2 / (np.pi * luminance),
    }  # fmt: skip
    ours = {
        "type": "doe_projector", "pattern": scenes.bitmap(pattern), "focal": focal,
        "to_world": pose, "power": 40.0,
    }  # fmt: skip
    images = []
    for emitter in (theirs, ours):
        mesh, _, _ = scenes.tilted_plane()
        scene = mi.load_dict(
            {"type": "scene", "surface": mesh, "camera": scenes.camera(), "light": emitter}
        )
        integrator = mi.load_dict({"type": "path", "max_depth": 3})
        images.append(np.array(mi.render(scene, integrator=integrator, spp=16, seed=1)))
    assert images[0].max() > 1e-2
    assert np.abs(images[0] - images[1]).max() < 1e-5 * images[0].max()


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_variants_agree(law: str, any_variant: str) -> None:
    """Oracle: the formula in NumPy, in a colour, a monochrome and a scalar variant."""
    import drjit as dr
    import mitsuba as mi

    emitter = load(law, power=3.0)
    q = np.array([12.3, 7.6])
    point = world_points(law, q)
    it = dr.zeros(mi.SurfaceInteraction3f)
    it.p = mi.Point3f(point.tolist())
    ds, weight = emitter.sample_direction(it, mi.Point2f(0.5))
    density = model(law).density_xyz(*model(law).unproject(q))
    expected = 3 / (scenes.PATTERN_WIDTH * scenes.PATTERN_HEIGHT) * density / 7**2
    np.testing.assert_allclose(np.array(weight).ravel(), expected, rtol=1e-4)
    assert float(np.ravel(ds.dist)[0]) == pytest.approx(7, rel=1e-5)
    ray, weight = emitter.sample_ray(0.0, 0.5, mi.Point2f(0.5), mi.Point2f(0.31, 0.84))
    np.testing.assert_allclose(np.array(weight).ravel(), 3.0, rtol=1e-4)
    direction = scenes.WORLD_FROM_PROJECTOR.inverse().rotate(np.array(ray.d).ravel())
    expected_q = np.array([0.31 * scenes.PATTERN_WIDTH, 0.84 * scenes.PATTERN_HEIGHT]) - 0.5
    np.testing.assert_allclose(model(law).project(direction), expected_q, atol=1e-3)


@pytest.mark.parametrize("name", [*scenes.PROJECTOR, "power"])
@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_derivatives_of_the_light(law: str, name: str, llvm: str) -> None:
    """Oracle: central differences of sample_direction on a linear ramp, for every parameter.

    1 % because the oracle itself is single precision.
    """
    import drjit as dr
    import mitsuba as mi

    x, y = np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 24))
    ramp = (1 + 0.7 * x + 0.3 * y)[..., None].astype(np.float32)  # no kinks between texels
    emitter = load(law, pattern=scenes.bitmap(ramp), power=500.0)
    params = mi.traverse(emitter)
    it = dr.zeros(mi.SurfaceInteraction3f)
    it.p = mi.Point3f(world_points(law, pattern_coordinates(300, margin=2.0)).T.astype(np.float32))
    weights = mi.Float(np.random.default_rng(1).uniform(0.5, 1.5, 300).astype(np.float32))

    def light(value: object):
        params[name] = mi.Float(value)
        params.update()
        _, weight = emitter.sample_direction(it, mi.Point2f(0.5))
        return dr.mean(weights * weight[0])

    start = float(params[name][0])
    step = 4e-3 * max(1.0, abs(start))
    expected = (light(start + step)[0] - light(start - step)[0]) / (2 * step)
    value = mi.Float(start)
    dr.enable_grad(value)
    dr.backward(light(value))
    assert dr.grad(value)[0] == pytest.approx(expected, rel=1e-2, abs=1e-4)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"law": "fresnel"}, "law"),
        ({"width": 0}, "width"),
        ({"focl": 3.0}, "focl"),
        ({"focal": 0.0}, '"focal" must be a finite number above 0, got 0'),
        ({"focal": -38.0}, '"focal"'),
        ({"focal": float("nan")}, '"focal"'),
        ({"focal": 1e39}, '"focal"'),  # infinite in single precision
        ({"aspect": -1.0}, '"aspect"'),
        ({"aspect": float("inf")}, '"aspect"'),
        ({"centre_x": float("nan")}, '"centre_x" must be a finite number, got nan'),
        ({"centre_y": float("inf")}, '"centre_y"'),
        ({"p2": float("nan")}, '"p2"'),
        ({"power": float("inf")}, '"power"'),
    ],
)
def test_wrong_parameters_are_named(changes: dict, named: str, llvm: str) -> None:
    """Loading fails with the parameter's name in the message."""
    with pytest.raises(RuntimeError, match=named):
        load(**changes)


def test_scaled_pose_is_refused(llvm: str) -> None:
    """A projector has no size: a scale in to_world would silently change its intensity."""
    import mitsuba as mi

    with pytest.raises(RuntimeError, match="to_world"):
        load(to_world=mi.ScalarTransform4f().scale(2.0))
