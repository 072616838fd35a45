"""Mitsuba's axes against Mitsuba itself."""

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.rendering.axes import (
    fraction_from_pixel,
    is_rigid,
    pixel_from_fraction,
    pose_from_to_world,
    swap_axes,
    to_world_from_pose,
)

POSE = RigidTransform.of([0.2, -0.5, 0.3], [4.0, -2.0, 7.0])


def test_lookat_is_an_opencv_pose(llvm: str) -> None:
    """Oracle: the definition. z to the target, x to the right of it, y down, seen with up = -y."""
    import mitsuba as mi

    made = mi.ScalarTransform4f().look_at([1.0, 2.0, 3.0], [1.0, 2.0, 9.0], [0.0, -1.0, 0.0])
    pose = pose_from_to_world(np.array(made.matrix))
    np.testing.assert_allclose(pose.R, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(pose.t, [1, 2, 3], atol=1e-6)


def test_pixels_of_mitsubas_perspective(llvm: str) -> None:
    """Oracle: ``perspective`` places x right, y down, and the first pixel's centre at 0.5."""
    import mitsuba as mi

    film = {"type": "hdrfilm", "width": 40, "height": 30}
    camera = mi.load_dict(
        {"type": "perspective", "fov": 53.13010235, "film": film,
         "to_world": mi.ScalarTransform4f(to_world_from_pose(POSE).tolist())}
    )  # fmt: skip
    s, t = fraction_from_pixel(31, 4, 40, 30)
    ray, _ = camera.sample_ray(0.0, 0.5, mi.Point2f(s, t), mi.Point2f(0.5))
    expected = POSE.rotate(np.array([(31 - 19.5) / 40, (4 - 14.5) / 40, 1.0]))
    np.testing.assert_allclose(ray.d.numpy()[:, 0], expected / np.linalg.norm(expected), atol=1e-6)


def test_conversions_are_inverse() -> None:
    """Oracle: the identity."""
    back = pose_from_to_world(to_world_from_pose(POSE))
    np.testing.assert_allclose(back.matrix(), POSE.matrix())
    assert swap_axes(swap_axes((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)
    assert pixel_from_fraction(*fraction_from_pixel(3.25, -0.5, 40, 30), 40, 30) == pytest.approx(
        (3.25, -0.5)
    )


def test_rigid_is_without_scale_and_mirror() -> None:
    """Oracle: constructed matrices."""
    assert is_rigid(to_world_from_pose(POSE))
    assert not is_rigid(np.diag([1.01, 1, 1, 1.0]))
    assert not is_rigid(np.diag([-1.0, 1, 1, 1]))
