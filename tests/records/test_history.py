"""The history of an optimisation on disk."""

from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Snapshot
from mitsuba_endo.records.history import (
    FILE,
    KEPT,
    load_history,
    save_history,
    scaled,
    thinned,
)

FACES = [np.array([[0, 1, 2], [2, 1, 3]]), np.array([[2, 0, 1]])]


def snapshot(iteration: int, faces: list[np.ndarray]) -> Snapshot:
    rng = np.random.default_rng(iteration)
    poses = [RigidTransform.of([0.1 * i, -0.2, iteration], [i, 2, 3]) for i in range(2)]
    return Snapshot(
        iteration, None if iteration == 0 else 1 / iteration,
        None if iteration == 0 else 2 / iteration, [300.0 + iteration, 290.0],
        [rng.normal([0, 0, 7], size=(f.max() + 1, 3)) for f in faces], faces, poses, poses[::-1],
    )  # fmt: skip


def test_comes_back(tmp_path: Path):
    """Oracle: what was written, vertices to half precision (2^-11 of their size); a mesh that
    changes on the way."""
    grown = [np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]]), FACES[1]]
    history = [snapshot(0, FACES), snapshot(1, FACES), snapshot(2, grown)]
    save_history(tmp_path / FILE, history)
    found = load_history(tmp_path)
    assert [s.iteration for s in found] == [0, 1, 2]
    assert [s.cost for s in found] == [None, 1.0, 0.5]
    assert [s.scale_px for s in found] == [None, 2.0, 1.0]
    for mine, read in zip(history, found, strict=True):
        assert read.focal == mine.focal
        for a, b in zip(mine.surfaces, read.surfaces, strict=True):
            np.testing.assert_allclose(b, a, atol=10 * 2**-11)
        for a, b in zip(mine.faces, read.faces, strict=True):
            np.testing.assert_array_equal(b, a)
        for name in ("world_from_camera", "projector_from_camera"):
            for a, b in zip(getattr(mine, name), getattr(read, name), strict=True):
                np.testing.assert_array_equal(b.matrix(), a.matrix())
    assert found[0].faces is found[1].faces


def test_absent_is_empty_and_damaged_is_told(tmp_path: Path):
    """Oracle: folders from before there was a history; the file's name."""
    assert load_history(tmp_path) == []
    (tmp_path / FILE).write_bytes(b"PK\x03\x04 not a zip file")
    with pytest.raises(InputError, match=r"history\.npz: is not a readable history"):
        load_history(tmp_path)


def test_thinned_keeps_both_ends():
    """Oracle: the first and the last, in order, no more than asked for."""
    history = [snapshot(i, FACES) for i in range(205)]
    kept = [s.iteration for s in thinned(history)]
    assert len(kept) == KEPT
    assert kept[0] == 0
    assert kept[-1] == 204
    assert kept == sorted(set(kept))
    assert max(np.diff(kept)) <= 6
    assert thinned(history[:5]) == history[:5]


def test_scaled_moves_lengths_alone():
    """Oracle: X_to = R X_from + t holds after both sides were multiplied."""
    before = snapshot(3, FACES)
    (after,) = scaled([before], 6.2)
    for old, new in zip(before.projector_from_camera, after.projector_from_camera, strict=True):
        x = before.surfaces[0]
        np.testing.assert_allclose(new.apply(6.2 * x), 6.2 * old.apply(x))
    assert after.focal == before.focal
