"""The lumen's maps, poses, surface and visibility agree with each other, by other ways."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mitsuba_endo.evaluate.distance import distance_to_mesh
from tests.lumen import SIZE, WITHDRAWAL, Lumen, withdrawn


@pytest.fixture(scope="module")
def lumen() -> Lumen:
    return withdrawn(4, noise=0.0)


def seen_points(lumen: Lumen, k: int) -> NDArray[np.float64]:
    """(N, 3) points with a correspondence, world."""
    return lumen.world_from_camera[k].apply(lumen.points[k][lumen.maps[k].valid])


def test_midpoints_of_the_rays_are_the_points(lumen: Lumen) -> None:
    """Two rays of a frame, from the map alone, meet at its point (float32 maps: microns)."""
    for k, own in enumerate(lumen.projector_from_camera):
        valid = lumen.maps[k].valid
        a = lumen.camera.grid_rays[valid]
        b = own.inverse().rotate(lumen.projector.unproject(lumen.maps[k].q[valid].astype(float)))
        origin = own.inverse().t
        # s a - r b = origin, in least squares: Cramer's rule
        ab, ao, bo = (a * b).sum(1), a @ origin, b @ origin
        s = (ao - ab * bo) / (1 - ab**2)
        assert np.abs(s - lumen.ranges[k][valid]).max() < 0.05
        assert np.median(np.abs(s - lumen.ranges[k][valid])) < 1e-3


def test_poses_put_all_frames_on_one_surface(lumen: Lumen) -> None:
    for k in range(4):
        points = seen_points(lumen, k)[::17]
        distance = distance_to_mesh(points, lumen.mesh.vertices, lumen.mesh.faces)
        assert distance.max() < 1e-3


def test_the_endoscope_is_withdrawn(lumen: Lumen) -> None:
    z = np.array([pose.t[2] for pose in lumen.world_from_camera])
    assert np.allclose(np.diff(z), -WITHDRAWAL, atol=2)
    assert all(5 < np.linalg.norm(pose.t) < 6.5 for pose in lumen.projector_from_camera)


def test_most_of_a_frame_is_lit_and_ranges_are_an_endoscopes(lumen: Lumen) -> None:
    for m, r in zip(lumen.maps, lumen.ranges, strict=True):
        assert 0.8 < m.valid.mean() < 1  # folds cast shadows
        assert np.nanmin(r) > 10
        assert np.nanmax(r) <= 65
        assert (np.nanmax(m.q, axis=(0, 1)) < SIZE).all()


def test_seen_vertices_are_those_near_seen_points(lumen: Lumen) -> None:
    """Pixels say the same as rays towards vertices, but for pixels' and triangles' size."""
    for k in range(4):
        points, vertices = seen_points(lumen, k), lumen.mesh.vertices
        # Pixels are far apart on a wall that is seen edge on.
        assert np.quantile(KDTree(points).query(vertices[lumen.seen[k]])[0], 0.995) < 1.5
        near = np.asarray(KDTree(vertices).query(points, k=8)[1])
        assert lumen.seen[k][near].any(1).mean() > 0.99


def test_later_frames_see_much_that_the_first_does_not(lumen: Lumen) -> None:
    hidden = lumen.hidden_from_first
    assert not (hidden & lumen.seen[0]).any()
    share = lumen.areas[hidden].sum() / lumen.areas[lumen.seen.any(0)].sum()
    assert 0.3 < share < 0.7


def test_completeness_counts_area_that_is_near(lumen: Lumen) -> None:
    """The true surface covers itself; without the faces on one side, it does not."""
    mesh, of = lumen.mesh, lumen.seen.any(0)
    assert lumen.completeness(mesh.vertices, mesh.faces, of) == 1
    left = (mesh.vertices[mesh.faces][..., 0] < 0).all(1)
    share = lumen.completeness(mesh.vertices, mesh.faces[left], of)
    west = lumen.areas[of & (mesh.vertices[:, 0] < 0)].sum() / lumen.areas[of].sum()
    assert share == pytest.approx(west, abs=0.05)


def test_noise_is_white_and_as_asked(lumen: Lumen) -> None:
    noisy = withdrawn(4, noise=0.3)
    error = noisy.maps[2].q - lumen.maps[2].q
    error = error[np.isfinite(error).all(-1)]
    assert error.std(0) == pytest.approx(0.3, rel=0.03)
    assert noisy.maps[2].valid.mean() == lumen.maps[2].valid.mean()
