"""From a start to the first surface."""

import numpy as np
import pytest

from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.solve.frames.initial_state import (
    MAX_VERTICES,
    PER_VERTEX,
    cell_size,
    initial_rho,
    observations,
    pixel_angle,
    smooth_samples,
    whitening,
)
from mitsuba_endo.solve.surfaces.inverse_range_lattice import lattice_over
from tests.rigs import lopsided_camera
from tests.solve.problems import SHEET, small_rig


def test_observations_keep_pixels_rays_and_coordinates_together():
    """Oracle: each ray, projected, is its pixel; each coordinate is the map's there."""
    rig = small_rig("pinhole")
    used = np.isfinite(rig.q[..., 0])
    used[:, ::3] = False
    frame = observations(CorrespondenceMap(rig.q.astype(np.float32), "a"), used, rig.camera)
    assert frame.shape == (80, 96)
    assert len(frame.rays) == used.sum()
    np.testing.assert_allclose(rig.camera.project(frame.rays), frame.pixels, atol=1e-6)
    x, y = frame.pixels.T
    np.testing.assert_allclose(frame.q.T, rig.q[y, x], atol=1e-4)


def test_whitening_is_the_inverse_of_the_covariance():
    """Oracle: NumPy's inverse of each matrix over the mean of its variances, by the weight."""
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 8, 2, 2))
    full = root @ np.swapaxes(root, -1, -2) + 0.05 * np.eye(2)
    covariance = np.stack([full[..., 0, 0], full[..., 0, 1], full[..., 1, 1]], -1)
    covariance[0, 0] = np.nan  # nothing known: alike in both
    weight = rng.uniform(0.1, 1, (6, 8)).astype(np.float32)
    map_ = CorrespondenceMap(
        np.zeros((6, 8, 2), np.float32), "a", weight, covariance.astype(np.float32)
    )
    used = np.ones((6, 8), bool)
    W = whitening(map_, used)
    assert W is not None
    found = np.einsum("kin,kjn->nij", W, W)
    mean = np.trace(full, axis1=-2, axis2=-1)[..., None, None] / 2
    expected = weight[..., None, None] * np.linalg.inv(full / mean)
    expected[0, 0] = weight[0, 0] * np.eye(2)
    np.testing.assert_allclose(found, expected.reshape(-1, 2, 2), rtol=1e-4)


class TestCellSize:
    def frame(self, part: np.ndarray):
        camera = lopsided_camera(200, 120)
        q = np.zeros((120, 200, 2), np.float32)
        return observations(CorrespondenceMap(q, "a"), part, camera), camera

    def test_of_a_full_map(self):
        """Oracle: nine pixels a vertex make cells of three pixels."""
        frame, camera = self.frame(np.ones((120, 200), bool))
        assert cell_size(frame, camera, None) == pytest.approx(3 * pixel_angle(camera), rel=1e-9)

    def test_of_a_sparse_map(self):
        """Oracle: a quarter of the pixels make cells twice as wide."""
        part = np.zeros((120, 200), bool)
        part[::2, ::2] = True
        frame, camera = self.frame(part)
        assert cell_size(frame, camera, None) == pytest.approx(6 * pixel_angle(camera), rel=1e-9)

    def test_given_in_pixels(self):
        """Oracle: the number given times the angle of a pixel: 1 / focal length at the centre."""
        frame, camera = self.frame(np.ones((120, 200), bool))
        assert cell_size(frame, camera, 5.0) == pytest.approx(5 * pixel_angle(camera))
        assert pixel_angle(camera) == pytest.approx(1 / camera.K[0, 0], rel=0.15)

    def test_has_a_limit(self):
        """Oracle: the number of vertices of a map too large for nine pixels each."""
        camera = lopsided_camera(600, 400)
        part = np.ones((400, 600), bool)
        frame = observations(
            CorrespondenceMap(np.zeros((400, 600, 2), np.float32), "a"), part, camera
        )
        assert part.sum() / PER_VERTEX > MAX_VERTICES
        cell = cell_size(frame, camera, None) / pixel_angle(camera)
        assert part.sum() / cell**2 == pytest.approx(MAX_VERTICES, rel=0.02)


class TestInitialRho:
    def test_is_the_median_of_the_nearest_samples(self):
        """Oracle: the sheet's own range at the vertices, in spite of 20 % wild samples."""
        camera = lopsided_camera(96, 80)
        rays = camera.rays(camera.pixel_grid()).reshape(-1, 3)
        rays = rays[rays[:, 2] > 0.85]
        lattice = lattice_over(rays, 5 * pixel_angle(camera), margin=1)
        ranges = SHEET(rays)
        wild = np.random.default_rng(0).random(len(rays)) < 0.2
        rho = initial_rho(lattice, rays, np.where(wild, 500.0, ranges))
        near = lattice.nearest(rays)
        inner = np.bincount(near[near >= 0], minlength=lattice.size) >= 20
        relative = rho[inner] * SHEET(lattice.directions[inner]) - 1
        assert np.abs(relative).max() < 0.06
        assert np.median(np.abs(relative)) < 0.01

    def test_fills_what_no_sample_meets(self):
        """Oracle: every vertex is finite and within the range of the samples."""
        camera = lopsided_camera(96, 80)
        rays = camera.rays(camera.pixel_grid()).reshape(-1, 3)
        lattice = lattice_over(rays, 0.05, margin=2)
        ranges = np.where(rays[:, 0] < 0, 60.0, np.nan)
        ranges[rays[:, 0] < -0.2] = -1.0
        np.testing.assert_allclose(initial_rho(lattice, rays, ranges), 1 / 60)


def test_smooth_samples_follow_the_pixels():
    """Oracle: the depth image at the pixels, since a median keeps a constant."""
    rig = small_rig("pinhole")
    used = np.isfinite(rig.q[..., 0])
    frame = observations(CorrespondenceMap(rig.q.astype(np.float32), "a"), used, rig.camera)
    depth = np.where(np.arange(96) < 48, 10.0, 20.0) * np.ones((80, 1))
    rays, ranges = smooth_samples(depth, frame)
    np.testing.assert_array_equal(rays, frame.rays)
    away = np.abs(frame.pixels[:, 0] - 47.5) > 5
    expected = np.where(frame.pixels[:, 0] < 48, 10.0, 20.0)
    np.testing.assert_allclose(ranges[away], expected[away], rtol=1e-6)  # float32 inside
