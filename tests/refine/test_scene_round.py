"""The second round: matches along epipolar lines, against exact geometry and coordinates."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.refine.cells import SIDE
from mitsuba_endo.refine.epipolar_sweep import sweep
from mitsuba_endo.refine.image_view import view_of
from mitsuba_endo.refine.pattern_image import grid_image
from mitsuba_endo.refine.refine_map import refine_map
from mitsuba_endo.refine.scene_round import refine_against_scene
from mitsuba_endo.refine.semi_global_matching import aggregated
from tests.refine.scene_views import coordinates_of, geometry, missing, turned
from tests.refine.views import GRID, HEIGHT, PERIOD, WIDTH, photo, wrong_by

PATTERN = grid_image(GRID)


def _first(truth: np.ndarray, image: np.ndarray, hole: np.ndarray) -> CorrespondenceMap:
    q = np.where(hole[..., None], np.float32(np.nan), wrong_by(truth, 0.2).q)
    return refine_map(CorrespondenceMap(q, "frame"), image, PATTERN).map


def _hole(rows: slice, columns: slice) -> np.ndarray:
    hole = np.zeros((HEIGHT, WIDTH), bool)
    hole[rows, columns] = True
    return hole


def test_paths_are_the_cheapest_ones():
    """Oracle: all ways through a line of five cells, enumerated."""
    w, levels, p1, p2 = 5, 4, 0.3, 0.8
    line = np.random.default_rng(2).random((w, levels)).astype(np.float32)

    def change(a: int, b: int) -> float:
        return 0.0 if a == b else min(p1 if abs(a - b) == 1 else np.inf, p2)

    def cheapest(costs: np.ndarray, at: int, level: int) -> float:
        ways = (way for way in product(range(levels), repeat=at + 1) if way[-1] == level)
        return min(sum(costs[i, d] for i, d in enumerate(way))
                   + sum(change(a, b) for a, b in pairwise(way))
                   for way in ways)  # fmt: skip

    def path(costs: np.ndarray, at: int, level: int) -> float:
        before = min(cheapest(costs, at - 1, d) for d in range(levels)) if at else 0.0
        return cheapest(costs, at, level) - before

    found = aggregated(line[None], p1, p2)[0]
    for at, level in product(range(w), range(levels)):
        both = path(line, at, level) + path(line[::-1], w - 1 - at, level)
        assert found[at, level] == pytest.approx((both + 6 * line[at, level]) / 8, abs=1e-5)


def test_the_image_of_a_volume_has_no_direction():
    """Oracle: a volume turned by a quarter and mirrored gives the same, turned and mirrored."""
    cost = np.random.default_rng(3).random((7, 9, 5)).astype(np.float32)
    plain = aggregated(cost, 0.1, 0.5)
    np.testing.assert_allclose(aggregated(np.rot90(cost), 0.1, 0.5), np.rot90(plain), atol=1e-5)
    np.testing.assert_allclose(aggregated(cost[:, ::-1], 0.1, 0.5), plain[:, ::-1], atol=1e-5)


def test_every_cell_is_found_on_its_line():
    """Oracle: the exact coordinates, also where no range is known and the wall steps forward."""
    known = geometry(fold=True)
    truth = coordinates_of(known)
    x = np.arange(WIDTH)[None]
    seen = missing(known, np.broadcast_to(x > 110, truth.shape[:2]))
    view = view_of(photo(truth), np.isfinite(seen.range), 2.2)
    found = sweep(seen, view, PATTERN, 0.6, 6.0)
    at = truth[SIDE // 2 :: SIDE, SIDE // 2 :: SIDE]
    off = np.linalg.norm(found.q[: len(at), : at.shape[1]] - at, axis=-1)
    away = np.abs(SIDE * np.arange(off.shape[1]) - 130) > 10
    inside = off[3:-3, 3:-3][:, away[3:-3]]
    assert np.mean(inside < 3) > 0.98
    np.testing.assert_allclose(np.linalg.norm(found.along, axis=-1), 1, atol=1e-5)


def test_a_hole_is_read_along_the_lines():
    """Oracle: the exact coordinates in a hole far wider than growth, under speckle."""
    known = geometry()
    truth, hole = coordinates_of(known), _hole(slice(30, 120), slice(90, 180))
    image = photo(truth, speckle=0.3)
    first = _first(truth, image, hole)
    found = refine_against_scene(first, image, PATTERN, missing(known, ~first.valid))
    assert found.reason == ""
    assert not first.valid[60:90, 120:150].any()
    assert found.map.valid[hole].mean() > 0.9
    added = found.map.valid & ~first.valid
    assert found.grown == added.sum()
    error = found.map.q - truth
    assert np.abs(error[found.map.valid]).max() < 0.5 * PERIOD
    assert np.sqrt(np.mean(error[added] ** 2)) < 0.2
    covariance = found.map.covariance
    assert covariance is not None
    z = error[added] / np.sqrt(covariance[added][:, [0, 2]])
    assert 0.4 < float(np.sqrt(np.mean(z**2))) < 1.3


def test_what_is_confirmed_stays_as_it_was():
    """Oracle: the first map's own coordinates and covariances."""
    known = geometry()
    truth = coordinates_of(known)
    image = photo(truth)
    first = _first(truth, image, np.zeros((HEIGHT, WIDTH), bool))
    found = refine_against_scene(first, image, PATTERN, known)
    both = found.map.valid & first.valid
    assert both.mean() > 0.97 * first.valid.mean()
    np.testing.assert_array_equal(found.map.q[both], first.q[both])
    assert first.covariance is not None
    assert found.map.covariance is not None
    np.testing.assert_array_equal(found.map.covariance[both], first.covariance[both])
    assert found.map.correlation_px == first.correlation_px


def test_a_patch_off_its_lines_goes_and_is_read_anew():
    """Oracle: a patch moved by a period across its lines; after the round none of it is left."""
    known = geometry()
    truth = coordinates_of(known)
    image = photo(truth)
    first = _first(truth, image, np.zeros((HEIGHT, WIDTH), bool))
    patch = _hole(slice(40, 100), slice(60, 130))
    q = first.q + np.where(patch[..., None], np.array([0, PERIOD], np.float32), 0).astype(
        np.float32
    )
    found = refine_against_scene(replace(first, q=q), image, PATTERN, known)
    slipped = np.abs(found.map.q - truth).max(-1) > PERIOD / 2
    assert not slipped.any()
    assert found.map.valid[patch].mean() > 0.9


def test_nothing_is_read_where_no_pattern_is():
    """Oracle: a dark part with noise gets no coordinate, though its lines are known."""
    known = geometry()
    truth = coordinates_of(known)
    light = GRID.brightness(truth)
    light[:, 110:] = 0
    image = photo(truth, light=light, speckle=0.3)
    first = _first(truth, image, _hole(slice(None), slice(105, None)))
    found = refine_against_scene(first, image, PATTERN, missing(known, ~first.valid))
    assert not found.map.valid[:, 116:].any()


def test_a_wrong_calibration_changes_nothing_and_is_told():
    """Oracle: the very first map, and the sentence."""
    known = geometry()
    truth = coordinates_of(known)
    image = photo(truth)
    first = _first(truth, image, np.zeros((HEIGHT, WIDTH), bool))
    found = refine_against_scene(first, image, PATTERN, turned(known, 0.2))
    assert found.map is first
    assert "agree with the calibration's geometry" in found.reason
    assert (found.dropped, found.grown) == (0, 0)


def test_an_image_of_another_size_is_refused():
    """Oracle: the sentence of the first round."""
    known = geometry()
    truth = coordinates_of(known)
    image = photo(truth)
    first = _first(truth, image, np.zeros((HEIGHT, WIDTH), bool))
    with pytest.raises(InputError, match="the image is 190 x 150 pixels and the map 200 x 150"):
        refine_against_scene(first, image[:, :190], PATTERN, known)
