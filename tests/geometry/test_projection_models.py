"""Projection models: inverses, distortion, known figures, and agreement of NumPy with Dr.Jit."""

import cv2
import numpy as np
import pytest

from mitsuba_endo.geometry.projection_models import (
    PROJECTION_MODELS,
    ProjectorModel,
    projector_model,
)

DISTORTION = (-0.12, 0.03, 1e-3, -2e-3, 0.004)
WIDTH, HEIGHT = 640, 400


def projector(law: str, distortion: tuple[float, ...] = DISTORTION) -> ProjectorModel:
    return projector_model(law, 620.0, (301.5, 222.25), 1.03, distortion)


def scattered_q() -> np.ndarray:
    return np.random.default_rng(2).uniform([0, 0], [WIDTH, HEIGHT], (300, 2))


@pytest.mark.parametrize("law", PROJECTION_MODELS)
@pytest.mark.parametrize("distortion", [(), DISTORTION[:2], DISTORTION])
def test_unproject_is_the_inverse_of_project(law: str, distortion: tuple[float, ...]) -> None:
    """Oracle: the identity, for directions scaled to any length."""
    model, q = projector(law, distortion), scattered_q()
    lengths = np.random.default_rng(3).uniform(0.5, 80, (len(q), 1))
    np.testing.assert_allclose(model.project(model.unproject(q) * lengths), q, atol=1e-8)


def test_pinhole_is_opencvs_camera() -> None:
    """Oracle: cv2.projectPoints with the same five coefficients."""
    model = projector("pinhole")
    points = np.random.default_rng(5).uniform([-20, -15, 50], [20, 15, 80], (100, 3))
    K = np.array([[620.0, 0, 301.5], [0, 620 * 1.03, 222.25], [0, 0, 1]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(DISTORTION))
    np.testing.assert_allclose(model.project(points), expected[:, 0], atol=1e-9)


@pytest.mark.parametrize(("degrees", "stretch"), [(15, 0.035), (30, 0.155)])
def test_direction_cosine_stretches_the_grid(degrees: float, stretch: float) -> None:
    """Orders equally spaced in sin(theta) fall on a plane at tan(theta): 1 / cos(theta) wider."""
    model = projector_model("direction_cosine", 500.0, (0.0, 0.0))
    q = 500 * np.sin(np.radians(degrees))
    x, y, z = model.unproject(np.array([q, 0.0]))
    assert (x / z) / (q / 500) - 1 == pytest.approx(stretch, abs=5e-4)
    assert y == pytest.approx(0)


def test_evanescent_orders_and_points_behind_are_missing() -> None:
    """Direction cosines beyond 1 have no direction; a point behind has no coordinate."""
    model = projector_model("direction_cosine", 300.0, (0.0, 0.0))
    assert np.isnan(model.unproject(np.array([250.0, 200.0]))).all()
    assert np.isfinite(model.unproject(np.array([200.0, 200.0]))).all()
    assert np.isnan(model.project(np.array([1.0, 2.0, -5.0]))).all()


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_density_is_pattern_area_per_solid_angle(law: str) -> None:
    """Oracle: determinant of central differences of the projection along two tangents."""
    model = projector(law)
    d = model.unproject(scattered_q())
    first = np.cross(d, [0.2, 1.0, 0.1])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    step = 1e-5
    a, b = (
        (model.project(d + step * t) - model.project(d - step * t)) / (2 * step)
        for t in (first, np.cross(d, first))
    )
    expected = abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    np.testing.assert_allclose(model.density_xyz(*d.T), expected, rtol=1e-6)


@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_drjit_agrees_with_numpy(law: str, llvm: str) -> None:
    """Oracle: the NumPy evaluation, in double precision on both sides."""
    import drjit as dr
    from drjit.llvm.ad import Float64

    model, q = projector(law), scattered_q()
    lifted = model.with_(focal=Float64(model.focal))
    d = lifted.unproject_uv(Float64(q[:, 0]), Float64(q[:, 1]))
    d_numpy = np.stack(model.unproject_uv(q[:, 0], q[:, 1]), -1)
    np.testing.assert_allclose(np.stack([c.numpy() for c in d], -1), d_numpy, atol=1e-12)
    back = lifted.project_xyz(*d)
    np.testing.assert_allclose(np.stack([c.numpy() for c in back], -1), q, atol=1e-9)
    assert dr.width(back[0]) == len(q)


@pytest.mark.parametrize("law", PROJECTION_MODELS)
@pytest.mark.parametrize(
    "name", ["u", "v", "focal", "cx", "cy", "aspect", "k1", "k2", "p1", "p2", "k3"]
)
def test_derivatives_of_unproject(law: str, name: str, llvm: str) -> None:
    """Oracle: central differences in NumPy, step cbrt(eps) of the parameter's scale."""
    import drjit as dr
    from drjit.llvm.ad import Float64

    q = scattered_q()[:40]
    names = ("k1", "k2", "p1", "p2", "k3")
    values = {"u": q[:, 0], "v": q[:, 1], "focal": 620.0, "cx": 301.5, "cy": 222.25}
    values |= {"aspect": 1.03, **dict(zip(names, DISTORTION, strict=True))}

    def direction(p: dict) -> list:
        coefficients = [p[k] for k in names]
        model = projector_model(law, p["focal"], (p["cx"], p["cy"]), p["aspect"], coefficients)
        return model.unproject_uv(p["u"], p["v"])

    step = 6e-6 * max(1.0, float(np.max(np.abs(values[name]))))
    up, down = (direction({**values, name: values[name] + s * step}) for s in (1, -1))
    expected = (np.array(up) - np.array(down)) / (2 * step)

    lifted = {k: Float64(v) for k, v in values.items()}
    dr.enable_grad(lifted[name])
    # One output: Dr.Jit clears the gradients of outputs from which other outputs are computed.
    out = dr.concat([c + dr.zeros(Float64, len(q)) for c in direction(lifted)])
    dr.set_grad(lifted[name], 1.0)
    got = dr.forward_to(out).numpy().reshape(expected.shape)
    np.testing.assert_allclose(got, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())
