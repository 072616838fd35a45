"""What an optimisation tells about its way, and what a surface's errors have in common."""

import numpy as np
import pytest

from mitsuba_endo.records.calibration import Snapshot
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.inference.covariance import shared_modes
from mitsuba_endo.solve.surfaces.inverse_range_lattice import lattice_over
from tests.rigs import with_noise
from tests.solve.monte_carlo import FIELD
from tests.solve.problems import NOISE, map_of, rig_file, small_rig


@pytest.mark.usefixtures("llvm")
def test_history_leads_from_the_start_to_the_solution():
    """Oracle: the trace's iterations and costs; the solution's last values, in its unit; the
    observer sees the same in baselines."""
    rig = with_noise(small_rig("pinhole", FIELD), NOISE, 1)
    seen: list[Snapshot] = []
    found = calibrate([map_of(rig)], rig_file(rig), observe=seen.append)
    history = found.history
    assert [s.iteration for s in history] == [0, *(row.iteration for row in found.trace)]
    assert [s.cost for s in history] == [None, *(row.cost for row in found.trace)]
    last = history[-1]
    assert last.focal == [pytest.approx(found.solution.projector.focal.value, rel=1e-12)]
    pose = found.solution.frames[0].projector_from_camera
    np.testing.assert_allclose(last.projector_from_camera[0].matrix()[:3, :3], pose.R, atol=1e-12)
    np.testing.assert_allclose(last.projector_from_camera[0].t, pose.t, atol=1e-12)
    assert [s.iteration for s in seen] == [s.iteration for s in history]
    assert np.linalg.norm(seen[-1].projector_from_camera[0].t) == pytest.approx(1)
    depth = np.median(last.surfaces[0][:, 2])
    assert depth == pytest.approx(np.median(found.surface.vertices[:, 2]), rel=0.05)


def test_coarse_lattice_keeps_its_shape():
    """Oracle: directions of the lattice itself; no triangle over the hole that it has."""
    grid = np.stack(np.meshgrid(np.linspace(-0.4, 0.5, 90), np.linspace(-0.3, 0.2, 60)), -1)
    angles = grid.reshape(-1, 2)
    hole = np.hypot(*(angles - [0.2, -0.1]).T) < 0.1
    x, y = angles[~hole].T
    rays = np.stack([x, y, np.ones_like(x)], -1)
    lattice = lattice_over(rays / np.linalg.norm(rays, axis=1)[:, None], 0.012)
    kept, faces = lattice.coarsened(300)
    assert 150 < len(kept) < 400
    assert faces.max() == len(kept) - 1
    corners = lattice.coordinates[kept][faces]
    area = np.linalg.det(np.diff(corners, axis=1))
    assert (area > 0).all() | (area < 0).all()
    assert np.ptp(np.abs(area)) < 1e-12
    inside = np.hypot(*(corners.mean(1) - [0.2, -0.1]).T) < 0.07
    assert not inside.any()
    whole, all_faces = lattice.coarsened(10 * lattice.size)
    assert len(whole) == lattice.size
    # A lone missing cell has its four corners all the same.
    assert {*map(tuple, lattice.faces)} <= {*map(tuple, all_faces)}
    assert len(all_faces) < 1.01 * len(lattice.faces)


def test_modes_are_the_strongest_part_of_the_covariance():
    """Oracle: X C X^T; the best approximation of rank six by its eigenvalues (Eckart-Young)."""
    rng = np.random.default_rng(2)
    X = rng.normal(size=(50, 9)) * 10.0 ** -np.arange(9)
    root = rng.normal(size=(9, 9))
    covariance = root @ root.T
    full = X @ covariance @ X.T
    modes = shared_modes(X @ root)
    assert modes.shape == (50, 6)
    values = np.linalg.eigvalsh(full)
    missed = np.linalg.eigvalsh(full - modes @ modes.T)
    assert missed[0] > -1e-9 * values[-1]
    assert missed[-1] == pytest.approx(values[-7], rel=1e-4)
    assert shared_modes(X[:, :0]).shape == (50, 0)
