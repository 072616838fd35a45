"""The epipolar residual and its derivatives."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_from_vector, tangent_basis
from mitsuba_endo.initialisation.epipolar_residual import bearings, jacobian, residuals

POSE = RigidTransform.of([0.1, -0.2, 0.05], np.array([-0.8, 0.3, 0.25]) / np.sqrt(0.7925))
MODELS = {
    "pinhole": projector_model("pinhole", 410.0, (251.3, 190.2), 1.02),
    "pinhole distorted": projector_model(
        "pinhole", 410.0, (251.3, 190.2), 1.02, (-0.15, 0.1, 1e-3, -2e-3)
    ),
    "direction_cosine": projector_model("direction_cosine", 470.0, (251.3, 190.2), 0.97, (0.05,)),
}


@pytest.fixture(params=list(MODELS))
def projector(request):
    return MODELS[request.param]


def _points(count=40):
    rng = np.random.default_rng(3)
    rays = rng.uniform([-0.4, -0.3, 1], [0.4, 0.3, 1], (count, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return rays, rng.uniform(8, 14, count)


def _observed(projector, sigma):
    rays, depth = _points()
    q = projector.project(POSE.apply(depth[:, None] * rays))
    noise = sigma * np.random.default_rng(4).standard_normal(q.shape)
    return rays.T, (q + noise).T


def test_exact_correspondences_leave_no_residual(projector):
    """Oracle: a projected point lies on its own epipolar curve."""
    rays, q = _observed(projector, 0.0)
    assert np.abs(residuals(POSE, rays, bearings(projector, q)).r).max() < 1e-9


def test_residual_is_the_distance_to_the_epipolar_curve(projector):
    """Oracle: the distance from q to the projections of all depths, minimised numerically.

    The first-order distance is exact on a line; on a curve of radius above 300 px a residual of
    0.3 px differs from it by less than 0.3^2 / 300 px.
    """
    rays, q = _observed(projector, 0.3)
    r = residuals(POSE, rays, bearings(projector, q)).r
    for k in range(12):

        def distance(log_depth, k=k):
            return np.linalg.norm(
                projector.project(POSE.apply(np.exp(log_depth) * rays[:, k])) - q[:, k]
            )

        best = minimize_scalar(
            distance, bounds=(1.5, 3.2), method="bounded", options={"xatol": 1e-9}
        )
        assert abs(r[k]) == pytest.approx(best.fun, abs=1e-3)


def test_residual_does_not_depend_on_the_length_of_t(projector):
    """Oracle: correspondences fix no scale."""
    rays, q = _observed(projector, 0.3)
    seen = bearings(projector, q)
    longer = RigidTransform(POSE.R, 7.0 * POSE.t)
    np.testing.assert_allclose(
        residuals(longer, rays, seen).r, residuals(POSE, rays, seen).r, atol=1e-12
    )


def test_jacobian_agrees_with_finite_differences(projector):
    """Oracle: central differences of the residual; residuals of 3 px exercise every term."""
    rays, q = _observed(projector, 3.0)
    seen = bearings(projector, q)
    J = jacobian(POSE, projector, rays, q, seen, residuals(POSE, rays, seen), True)
    h = 1e-5

    def at(step):
        t = POSE.t + tangent_basis(POSE.t) @ step[3:5]
        pose = RigidTransform(rotation_from_vector(step[:3]) @ POSE.R, t / np.linalg.norm(t))
        moved = projector.with_(focal=projector.focal * np.exp(step[5]))
        return residuals(pose, rays, bearings(moved, q)).r

    numeric = np.array([(at(h * e) - at(-h * e)) / (2 * h) for e in np.eye(6)])
    assert np.abs(J - numeric).max() < 1e-5 * np.abs(numeric).max()


def test_a_nearby_focal_length_saves_work_but_changes_nothing():
    """Oracle: the bearings computed from scratch."""
    projector = MODELS["pinhole distorted"]
    _, q = _observed(projector, 0.3)
    moved = projector.with_(focal=projector.focal * 1.3)
    scratch, near = bearings(moved, q), bearings(moved, q, bearings(projector, q))
    np.testing.assert_allclose(near.b, scratch.b, atol=1e-12)
    np.testing.assert_allclose(near.b_u, scratch.b_u, atol=1e-12)


def test_coordinates_outside_the_law_are_nan():
    """Oracle: direction cosines above 1 belong to no direction."""
    projector = projector_model("direction_cosine", 100.0, (0.0, 0.0))
    q = np.array([[50.0, 120.0], [20.0, 0.0]])
    r = residuals(POSE, np.array([[0.1, 0.1], [0.0, 0.0], [1.0, 1.0]]), bearings(projector, q)).r
    assert np.isfinite(r[0])
    assert np.isnan(r[1])
