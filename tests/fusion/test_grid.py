"""Blocks are found where they were put, and meshes of noise have no edge with three faces."""

import numpy as np
import pytest

from mitsuba_endo.fusion import RangeFrame, Volume
from mitsuba_endo.fusion.blocks import BlockIndex, blocks_near, keys_of, places_of
from mitsuba_endo.fusion.grid import Grid
from mitsuba_endo.fusion.surface_nets import extract
from mitsuba_endo.geometry.transforms import RigidTransform
from tests.fusion.views import edge_counts, look, noisy, plane
from tests.rigs import lopsided_camera


def test_keys_tell_places_apart_also_below_zero() -> None:
    places = np.random.default_rng(0).integers(-(1 << 20) + 1, 1 << 20, (1000, 3))
    assert np.array_equal(places_of(keys_of(places)), places)
    with pytest.raises(ValueError, match="larger voxels"):
        keys_of(np.array([[0, -(1 << 20), 0]]))


def test_slots_stay_when_blocks_are_added() -> None:
    """Against a dictionary."""
    rng, index, wanted = np.random.default_rng(1), BlockIndex(), {}
    assert (index.find(np.zeros((2, 3), np.int64)) == -1).all()
    for _ in range(5):
        places = np.unique(rng.integers(-4, 4, (40, 3)), axis=0)
        slots = index.add(places)
        for place, slot in zip(map(tuple, places.tolist()), slots.tolist(), strict=True):
            assert wanted.setdefault(place, slot) == slot
    assert sorted(wanted.values()) == list(range(len(index)))
    assert all(tuple(index.places[slot].tolist()) == place for place, slot in wanted.items())
    assert index.find(np.array([[9, 9, 9]]))[0] == -1


def test_blocks_near_hold_a_block_around_every_point() -> None:
    rng = np.random.default_rng(2)
    points = rng.normal(0, 3, (50, 3))
    blocks = {tuple(place) for place in blocks_near(points, 1.7).tolist()}
    for step in rng.uniform(-1.7, 1.7, (100, 3)):
        around = np.floor((points + step) / 1.7).astype(int)
        assert {tuple(place) for place in around.tolist()} <= blocks


@pytest.fixture(scope="module")
def rough_plane() -> Volume:
    """Noise of more than a voxel, so that sheets nearly touch."""
    camera = lopsided_camera(80, 60)
    exact = look(plane((0.1, -0.2, 0.97), 40.0), camera, RigidTransform.identity())
    volume = Volume(0.4)
    volume.integrate(noisy(exact, 0.5 / 40**2, np.random.default_rng(0)))
    return volume


def test_no_four_quads_meet_in_an_edge(
    rough_plane: Volume, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without closing pinches some do."""
    assert len(edge_counts(extract(rough_plane).faces)) == 3
    monkeypatch.setattr("mitsuba_endo.fusion.surface_nets.close_pinches", lambda grid: None)
    assert len(edge_counts(extract(rough_plane).faces)) > 3


def test_a_block_with_the_next_layer_is_a_piece_of_one_array(rough_plane: Volume) -> None:
    """Against a dense array."""
    grid = Grid.of(rough_plane)
    low = grid.index.places.min(0)
    dense = np.full((grid.index.places.max(0) - low + 2) * 4, np.nan, np.float32)
    for place, values in zip(grid.index.places - low, grid.distance, strict=True):
        x, y, z = place * 4
        dense[x : x + 4, y : y + 4, z : z + 4] = values
    slots = np.arange(0, len(grid.index), 37)
    for slot, values in zip(slots, grid.with_next(slots), strict=True):
        x, y, z = (grid.index.places[slot] - low) * 4
        assert np.array_equal(values, dense[x : x + 5, y : y + 5, z : z + 5], equal_nan=True)


def test_an_empty_volume_has_no_surface() -> None:
    volume = Volume(1.0)
    assert len(extract(volume).vertices) == len(extract(volume).faces) == 0
    camera = lopsided_camera(8, 6)
    volume.integrate(RangeFrame(np.full((6, 8), np.nan), camera, RigidTransform.identity()))
    assert len(extract(volume).faces) == 0
