"""Omnidirectional cameras against their published formulas, their inverses and derivatives."""

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CAMERAS, CameraModel

K = np.array([[120.0, 0, 241.5], [0, 116.0, 160.2], [0, 0, 1]])
OMNI = ((0.9,), (0.9, -0.12, 0.03, 1e-3, -2e-3), (1.4, 0.1, -0.02, 1e-3, -2e-3, 5e-3))
DOUBLE_SPHERE = ((-0.2, 0.57), (0.3, 0.65), (0.0, 0.0), (0.1, 0.4), (-0.3, 1.0))
SCARAMUZZA = ((), (0.0, -0.45), (0.02, -0.4, 0.05, -0.06), (0.02, -0.4, 0.05, -0.06, 3e-3, -2e-3))
MODELS = [
    *(("omni", c) for c in OMNI),
    *(("double_sphere", c) for c in DOUBLE_SPHERE),
    *(("scaramuzza", c) for c in SCARAMUZZA),
]


def directions(largest: float, count: int = 300) -> np.ndarray:
    """Return unit directions (N, 3) up to an angle to the axis, degrees."""
    rng = np.random.default_rng(5)
    theta = np.radians(rng.uniform(0.5, largest, count))
    phi = rng.uniform(-np.pi, np.pi, count)
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


def widest(model: str, coefficients: Sequence[float]) -> float:
    """Return an angle, degrees, well within what a camera of MODELS sees."""
    narrow = [("double_sphere", (0.0, 0.0)), ("double_sphere", (-0.3, 1.0)), ("scaramuzza", ())]
    return 65.0 if (model, tuple(coefficients)) in narrow else 100.0


@pytest.mark.parametrize("coefficients", OMNI)
def test_omni_is_opencvs_distortion_of_a_shifted_sphere(coefficients):
    """Oracle: Mei's two steps by hand, then cv2.projectPoints for plane, distortion and matrix."""
    xi, *brown = coefficients
    d = directions(95)
    shifted = d + np.array([0, 0, xi])
    lens = np.array([*brown, *[0.0] * (5 - len(brown))])
    expected, _ = cv2.projectPoints(shifted, np.zeros(3), np.zeros(3), K, lens)
    camera = CameraModel("omni", 480, 320, K, coefficients)
    np.testing.assert_allclose(camera.project(42.0 * d), expected[:, 0], atol=1e-8)


def test_double_sphere_is_the_papers():
    """Oracle: equations 40 to 42 by hand for the points (3, 0, 4) and (0, -5, -0.1)."""
    camera = CameraModel("double_sphere", 480, 320, np.eye(3), (-0.2, 0.57))
    # d1 = 5, xi d1 + z = 3, d2 = sqrt(9 + 9).
    assert camera.project(np.array([3.0, 0, 4]))[0] == pytest.approx(
        3 / (0.57 * np.sqrt(18) + 0.43 * 3)
    )
    d1 = np.sqrt(25.01)
    shifted = -0.2 * d1 - 0.1
    expected = -5 / (0.57 * np.sqrt(25 + shifted**2) + 0.43 * shifted)
    assert camera.project(np.array([0.0, -5, -0.1]))[1] == pytest.approx(expected)


def test_scaramuzza_is_ocamcalibs():
    """Oracle: cam2world of OCamCalib, rows before columns and z towards the camera, for its own
    coefficients in pixels."""
    a = (-272.0, 0.0, 1.1e-3, -2.0e-7, 8.0e-10)
    c, d, e, row, column = 1.0014, -8.2e-4, 2.2e-4, 158.6, 241.1
    f = abs(a[0])
    b = tuple(a[k] * f**k / a[0] for k in range(1, 5))
    matrix = np.array([[f, 0, column], [0, c * f, row], [0, 0, 1]])
    camera = CameraModel("scaramuzza", 480, 320, matrix, (*b, d / c, e))
    pixels = camera.pixel_grid()[::7, ::9].reshape(-1, 2)
    stretch = np.linalg.inv([[c, d], [e, 1]])
    down, right = stretch @ (pixels[:, ::-1] - [row, column]).T
    rho = np.hypot(down, right)
    rays = np.stack([right, down, -np.polyval(a[::-1], rho)], -1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    np.testing.assert_allclose(camera.rays(pixels), rays, atol=1e-12)
    np.testing.assert_allclose(camera.project(30 * rays), pixels, atol=1e-8)


@pytest.mark.parametrize(("model", "coefficients"), MODELS)
def test_projection_and_rays_are_inverse(model, coefficients):
    """Oracle: the identity, beyond 90 degrees where the model sees so far."""
    camera = CameraModel(model, 480, 320, K, coefficients)
    d = directions(widest(model, coefficients))
    np.testing.assert_allclose(camera.rays(camera.project(7.3 * d)), d, atol=1e-9)
    axis = camera.project(np.array([0.0, 0, 5]))
    np.testing.assert_allclose(axis, K[:2, 2], atol=1e-9)
    np.testing.assert_allclose(camera.rays(axis), [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize(("model", "coefficients"), MODELS)
def test_density_is_pixel_area_per_solid_angle(model, coefficients):
    """Oracle: determinant of central differences of ``normalise`` along two tangents."""
    law, d = CAMERAS[model], directions(widest(model, coefficients))
    first = np.cross(d, [0.1, 1.0, 0.2])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    step = 1e-5

    def slope(tangent: np.ndarray) -> np.ndarray:
        ends = [law.normalise(coefficients, *(d + s * step * tangent).T) for s in (1, -1)]
        return (np.array(ends[0]) - np.array(ends[1])) / (2 * step)

    (ax, bx), (ay, by) = slope(first), slope(np.cross(d, first))
    area, seen = law.density(coefficients, *(3.1 * d).T)
    assert seen.all()
    assert np.all(law.projectable(coefficients, *d.T))
    np.testing.assert_allclose(area, abs(ax * by - ay * bx), rtol=1e-6)


@pytest.mark.parametrize(("model", "coefficients"), [m for m in MODELS if m[1]])
def test_what_no_pixel_sees_is_masked(model, coefficients):
    """Oracle: a direction is seen if its pixel's ray is that direction, but for 2 degrees."""
    law = CAMERAS[model]
    theta = np.radians(np.linspace(1, 179, 800))
    d = np.stack([0.6 * np.sin(theta), -0.8 * np.sin(theta), np.cos(theta)], -1)
    with np.errstate(all="ignore"):
        seen = law.density(coefficients, *d.T)[1] & law.projectable(coefficients, *d.T)
        a, b = law.normalise(coefficients, *d.T)
        rays = np.stack(law.direction(coefficients, a, b), -1)
        error = np.linalg.norm(rays / np.linalg.norm(rays, axis=1, keepdims=True) - d, axis=1)
    inverse = (error < 1e-6) & (np.hypot(a, b) < 5)  # focal lengths: any image ends before
    seen &= np.hypot(a, b) < 5
    edges = [theta[np.argmin([*mask, False]) - 1] for mask in (seen, inverse)]
    assert edges[0] > np.radians(60)
    assert edges[1] - np.radians(2) < edges[0] < edges[1] + np.radians(0.3)


def lanes_of(values, count: int):
    from drjit.llvm.ad import Float64

    return [Float64(np.broadcast_to(v, count).astype(float)) for v in values]


def moved(function, variables, n: int, k: int, step: float) -> np.ndarray:
    values = [np.asarray(v, float) + step * (i == k) for i, v in enumerate(variables)]
    return np.array(function(values[:n], *values[n:]))


@pytest.mark.parametrize("name", ["normalise", "direction"])
@pytest.mark.parametrize(("model", "coefficients"), [m for m in MODELS if m[1]])
def test_derivatives_are_those_of_finite_differences(model, coefficients, name, llvm):
    """Oracle: central differences by every coefficient and coordinate, in double precision."""
    import drjit as dr

    law, d = CAMERAS[model], directions(62, 20)
    inputs = d.T if name == "normalise" else law.normalise(coefficients, *d.T)
    function, n = getattr(law, name), len(coefficients)
    variables = [*coefficients, *inputs]
    for k in range(len(variables)):
        lanes = lanes_of(variables, len(d))
        dr.enable_grad(lanes[k])
        dr.set_grad(lanes[k], 1.0)
        outputs = [2.0 * o for o in function(lanes[:n], *lanes[n:])]  # never the lane itself
        slopes = np.array([s.numpy() for s in dr.forward_to(*outputs)]) / 2
        ends = [moved(function, variables, n, k, step) for step in (1e-6, -1e-6)]
        np.testing.assert_allclose(slopes, (ends[0] - ends[1]) / 2e-6, rtol=1e-5, atol=1e-7)
