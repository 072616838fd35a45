"""Rigid transforms: composition, inverse, chart."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import (
    RigidTransform,
    angle_between,
    rotation_angle,
    rotation_from_vector,
    tangent_basis,
)

A = RigidTransform.of([0.3, -0.2, 0.5], [1.0, -2.0, 3.0])
B = RigidTransform.of([-0.1, 0.4, 0.2], [0.5, 6.0, -1.0])
POINTS = np.random.default_rng(0).normal(size=(7, 3))


def test_composition_and_inverse() -> None:
    """Oracle: homogeneous 4x4 matrices."""
    np.testing.assert_allclose((A @ B).matrix(), A.matrix() @ B.matrix(), atol=1e-14)
    np.testing.assert_allclose(A.inverse().matrix(), np.linalg.inv(A.matrix()), atol=1e-14)
    np.testing.assert_allclose((A @ B).apply(POINTS), A.apply(B.apply(POINTS)), atol=1e-13)
    np.testing.assert_allclose(A.rotate(POINTS), A.apply(POINTS) - A.t, atol=1e-13)


def test_perturbed_is_a_left_rotation_and_a_shift() -> None:
    """Oracle: the chart's definition with a known rotation about z."""
    moved = A.perturbed(np.array([0, 0, np.pi / 2, 0.1, 0.2, 0.3]))
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    np.testing.assert_allclose(moved.R, quarter @ A.R, atol=1e-14)
    np.testing.assert_allclose(moved.t, A.t + np.array([0.1, 0.2, 0.3]))


def test_angles() -> None:
    """Oracle: constructed angles, down to a millionth of a radian."""
    for angle in (1e-6, 0.4, 3.1):
        assert rotation_angle(rotation_from_vector([0, angle, 0])) == pytest.approx(angle, rel=1e-9)
        assert angle_between(
            np.array([2.0, 0, 0]), np.array([np.cos(angle), np.sin(angle), 0])
        ) == pytest.approx(angle, rel=1e-9)


def test_tangent_basis_is_orthonormal_and_perpendicular() -> None:
    """Oracle: Gram matrix of the columns and the direction."""
    d = np.array([0.2, -3.0, 1.0])
    basis = tangent_basis(d)
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-14)
    np.testing.assert_allclose(basis.T @ d, 0, atol=1e-14)
