"""Alignment: exact recovery, weights, mirror images and torn pairs."""

import numpy as np
import pytest
from trimesh.registration import procrustes

from mitsuba_endo.evaluate.alignment import Similarity, align, align_robustly
from mitsuba_endo.geometry.transforms import RigidTransform, rotation_from_vector

R = rotation_from_vector([0.3, -0.5, 0.2])
T = np.array([4.0, -7.0, 2.5])


def _points(n: int = 60) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(n, 3)) * [10, 6, 3] + [1, 2, 60]


@pytest.mark.parametrize("scale", [True, False])
def test_exact_recovery(scale: bool):
    """Oracle: the similarity that made the points."""
    truth = Similarity(1.7 if scale else 1.0, R, T)
    found = align(_points(), truth.apply(_points()), scale=scale)
    assert found.scale == pytest.approx(truth.scale, abs=1e-12)
    np.testing.assert_allclose(found.R, R, atol=1e-12)
    np.testing.assert_allclose(found.t, T, atol=1e-10)


def test_flat_points_give_a_rotation_not_a_mirror():
    """Oracle: det R = +1, and the flat points fall on their images."""
    flat = _points() * [1, 1, 0]
    target = flat * [1, -1, 1]  # a mirror image, which half a turn about x also makes
    found = align(flat, target, scale=False)
    assert np.linalg.det(found.R) == pytest.approx(1)
    np.testing.assert_allclose(found.apply(flat), target, atol=1e-10)


def test_true_mirror_image_is_not_matched_by_a_mirror():
    """Oracle: det R = +1 although only det R = -1 would fit."""
    assert np.linalg.det(align(_points(), _points() * [-1, 1, 1]).R) == pytest.approx(1)


def test_weights_leave_points_out():
    """Oracle: the truth of the points that have weight."""
    target = Similarity(1.0, R, T).apply(_points())
    target[:10] += 50
    weights = np.ones(60)
    weights[:10] = 0
    np.testing.assert_allclose(align(_points(), target, weights).t, T, atol=1e-9)


def test_weights_are_those_of_least_squares():
    """Oracle: the weighted sum of squares grows under every small change of the result."""
    rng = np.random.default_rng(1)
    source, weights = _points(), rng.uniform(0.1, 5, 60)
    target = Similarity(1.3, R, T).apply(source) + rng.normal(size=(60, 3))

    def cost(x: Similarity) -> float:
        return float(np.sum(weights * np.sum((target - x.apply(source)) ** 2, -1)))

    found = align(source, target, weights)
    for _ in range(30):
        step = rng.normal(size=7) * 1e-4
        other = RigidTransform(found.R, found.t).perturbed(step[:6])
        assert cost(Similarity(found.scale * np.exp(step[6]), other.R, other.t)) > cost(found)


@pytest.mark.parametrize("weighted", [False, True])
def test_no_similarity_fits_better(weighted: bool):
    """Oracle: trimesh's Procrustes, whose scale is the ratio of the two spreads and whose rotation
    is the best for equal weights only: its sum of squares is the larger one."""
    rng = np.random.default_rng(3)
    source = _points(200)
    target = source + rng.normal(size=source.shape)
    weights = rng.uniform(0.1, 5, 200) if weighted else np.ones(200)
    matrix, _, _ = procrustes(source, target, weights=weights, reflection=False)
    theirs = source @ matrix[:3, :3].T + matrix[:3, 3]
    ours = align(source, target, weights).apply(source)
    cost = [float(np.sum(weights[:, None] * (x - target) ** 2)) for x in (ours, theirs)]
    assert cost[0] <= cost[1] * (1 + 1e-12)


def test_scale_alone_is_about_the_origin():
    """Oracle: a uniform scaling, which moves no ray through the origin."""
    found = align(_points(), 2.5 * _points(), rotation=False)
    assert found.scale == pytest.approx(2.5)
    np.testing.assert_array_equal(found.R, np.eye(3))
    np.testing.assert_array_equal(found.t, np.zeros(3))


def test_too_few_points():
    """Oracle: two points leave a rotation undetermined."""
    with pytest.raises(ValueError, match="three points"):
        align(_points(2), _points(2))


@pytest.mark.parametrize("rotation", [True, False])
def test_torn_pairs_do_not_pull(rotation: bool):
    """Oracle: the similarity of the other pairs, though 10 % are torn apart by 30 %."""
    rng = np.random.default_rng(2)
    source = _points(500)
    truth = Similarity(1.4, R, T) if rotation else Similarity(1.4, np.eye(3), np.zeros(3))
    target = truth.apply(source) + 0.01 * rng.normal(size=source.shape)
    target[:50] *= 1.3
    found = align_robustly(source, target, scale=True, rotation=rotation)
    # 450 points of 0.01 mm noise at 60 mm: the scale is known to about 1e-5.
    assert found.scale == pytest.approx(1.4, abs=2e-4)
    np.testing.assert_allclose(found.apply(source)[50:], target[50:], atol=0.08)
