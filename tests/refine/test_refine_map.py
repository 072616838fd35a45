"""Refinement against exact coordinates of synthetic views."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.refine.options import RefineOptions
from mitsuba_endo.refine.pattern_image import PatternImage, grid_image
from mitsuba_endo.refine.refine_map import refine_map
from tests.refine.views import GRID, HEIGHT, PERIOD, WIDTH, coordinates, photo, rms, wrong_by

PATTERN = grid_image(GRID)


def _refined(truth, start, **settings):
    return refine_map(start, photo(truth, **settings), PATTERN)


def test_smooth_errors_of_the_start_go():
    """Oracle: the exact coordinates; a tenth of 0.6 pixels is left, as the covariance has it."""
    truth = coordinates()
    start = wrong_by(truth)
    found = _refined(truth, start)
    assert found.reason == ""
    assert found.refined > 0.98
    assert rms(start.q, truth) > 0.5
    assert rms(found.map.q, truth) < 0.06


def test_the_truth_stays_where_it_is():
    """Oracle: the truth itself; what is left is the start's smoothing and the image's noise."""
    truth = coordinates()
    found = _refined(truth, CorrespondenceMap(truth.astype(np.float32), "frame"))
    assert rms(found.map.q, truth) < 0.03


@pytest.mark.parametrize("speckle", [0.0, 0.25, 0.5])
def test_normalised_errors_are_near_one(speckle: float):
    """Oracle: errors over the standard deviations stated. The factors were tuned on photographs of
    tissue, where light scatters, so here deviations may be stated up to 2.5 times too large."""
    truth = coordinates()
    found = _refined(truth, wrong_by(truth, 0.3), speckle=speckle)
    assert found.map.covariance is not None
    covariance, error = found.map.covariance[8:-8, 8:-8], (found.map.q - truth)[8:-8, 8:-8]
    z = error / np.sqrt(covariance[..., [0, 2]])
    assert 0.4 < float(np.sqrt(np.mean(z**2))) < 1.3


def test_more_speckle_is_less_known():
    """Oracle: the order of the stated variances is that of the noise."""
    truth = coordinates()
    stated = [
        float(np.median(_refined(truth, wrong_by(truth), speckle=c).map.covariance[..., 0]))
        for c in (0.0, 0.25, 0.5)
    ]
    assert stated[0] < stated[1] < stated[2]


def test_no_window_spans_a_fold():
    """Oracle: beside the fold errors are as small as elsewhere, for the pattern jumps there by
    more than a period."""
    truth = coordinates(fold=True)
    found = _refined(truth, wrong_by(truth))
    beside = np.r_[90:98, 102:110]
    error = (found.map.q - truth)[8:-8]
    assert np.sqrt(np.nanmean(error[:, beside] ** 2)) < 0.15


def test_saturated_pixels_say_nothing():
    """Oracle: white blobs over an eighth of the lines at most double the error."""
    truth = coordinates()
    image = photo(truth)
    rng = np.random.default_rng(3)
    for x, y in rng.integers(10, [WIDTH - 10, HEIGHT - 10], (60, 2)):
        cv2.circle(image, (int(x), int(y)), 2, 255, -1)
    found = refine_map(wrong_by(truth), image, PATTERN)
    assert rms(found.map.q, truth) < 0.12


def test_the_response_matters_little_and_bits_not_at_all():
    """Oracle: the exact coordinates, from 16 bits and from a linear camera that says so."""
    truth, start = coordinates(), wrong_by(coordinates())
    deep = refine_map(start, photo(truth, bits=16), PATTERN)
    linear = refine_map(start, photo(truth, gamma=1.0), PATTERN, RefineOptions(gamma=1.0))
    wrong = refine_map(start, photo(truth, gamma=1.0), PATTERN)
    assert rms(deep.map.q, truth) < 0.06
    assert rms(linear.map.q, truth) < 0.06
    assert rms(wrong.map.q, truth) < 0.12


def test_holes_and_borders_are_grown_into():
    """Oracle: the exact coordinates where the start has none."""
    truth = coordinates()
    start = wrong_by(truth, 0.2)
    q = start.q.copy()
    q[60:70, 80:92] = np.nan
    q[:, :9] = np.nan
    found = refine_map(CorrespondenceMap(q, "frame"), photo(truth), PATTERN)
    missing = ~np.isfinite(q[..., 0])
    added = missing & found.map.valid
    assert found.grown == added.sum()
    assert added.sum() > 0.5 * missing.sum()
    error = np.abs(found.map.q - truth)[added]
    assert error.max() < 0.5 * PERIOD
    assert np.median(error) < 0.1
    none = refine_map(CorrespondenceMap(q, "frame"), photo(truth), PATTERN, RefineOptions(rounds=0))
    assert none.grown == 0
    assert not none.map.valid[missing].any()


def test_nothing_grows_where_no_pattern_is():
    """Oracle: the dark part of the image gets no coordinate."""
    truth = coordinates()
    light = GRID.brightness(truth)
    light[:, 120:] = 0
    q = wrong_by(truth, 0.2).q.copy()
    q[:, 118:] = np.nan
    found = refine_map(CorrespondenceMap(q, "frame"), photo(truth, light=light), PATTERN)
    assert not found.map.valid[:, 123:].any()


def test_a_patch_in_a_wrong_period_is_not_confirmed():
    """Oracle: the patch that was moved by a period; the code tells, and it is dropped."""
    truth = coordinates()
    q = wrong_by(truth, 0.1).q.copy()
    patch = (slice(40, 110), slice(110, 180))
    q[patch] += np.array([PERIOD, 0], np.float32)
    found = refine_map(CorrespondenceMap(q, "frame"), photo(truth), PATTERN)
    middle = (slice(50, 100), slice(120, 170))
    slipped = np.abs(found.map.q[middle] - truth[middle])[..., 0] > PERIOD / 2
    assert found.dropped > 0
    assert slipped.mean() < 0.2


def test_the_wrong_image_keeps_the_map_and_says_so():
    """Oracle: the very arrays of the start."""
    truth = coordinates()
    start = replace(wrong_by(truth), weight=np.full((HEIGHT, WIDTH), 0.5, np.float32))
    noise = np.random.default_rng(0).integers(0, 80, (HEIGHT, WIDTH)).astype(np.uint8)
    for image in (noise, np.zeros_like(noise), np.full_like(noise, 255)):
        found = refine_map(start, image, PATTERN)
        assert "the image confirms" in found.reason
        assert found.map is start
        assert found.refined == 0


def test_another_frame_is_not_confirmed():
    """Oracle: a photograph of the same scene 100 pattern pixels on refines nothing."""
    truth = coordinates()
    found = refine_map(wrong_by(truth, 0.1), photo(truth + np.array([103.0, 55.0])), PATTERN)
    assert found.refined < 0.5


def test_what_the_image_does_not_confirm_keeps_the_start_with_its_weight():
    """Oracle: coordinates under a black patch, and the ratio of the start's weights."""
    truth = coordinates()
    start = wrong_by(truth, 0.2)
    weight = np.ones((HEIGHT, WIDTH), np.float32)
    weight[:, 50:] = 0.25
    image = photo(truth)
    image[40:110, 20:90] = 0
    found = refine_map(replace(start, weight=weight), image, PATTERN)
    covariance = found.map.covariance
    assert covariance is not None
    for at in ((75, 45), (75, 62)):
        np.testing.assert_array_equal(found.map.q[at], start.q[at])
    assert covariance[75, 62, 0] / covariance[75, 45, 0] == pytest.approx(4)
    assert found.map.weight is not None
    assert 0 < found.map.weight[75, 45] < found.map.weight[20, 150] <= 1


def test_weights_follow_the_covariance_and_files_would_take_them():
    """Oracle: 1 / mean variance relative to the best."""
    truth = coordinates()
    map_ = _refined(truth, wrong_by(truth)).map
    assert map_.covariance is not None
    assert map_.weight is not None
    variance = (map_.covariance[..., 0] + map_.covariance[..., 2]) / 2
    np.testing.assert_allclose(map_.weight, np.nanmin(variance) / variance, rtol=1e-5)
    assert map_.correlation_px is not None


def test_wide_images_and_tall_ones():
    """Oracle: the transposed problem with x and y exchanged has the transposed solution."""
    truth = coordinates()
    texture = PATTERN.texture
    turned = PatternImage(np.ascontiguousarray(texture.T), PATTERN.height, PATTERN.width)
    start, image = wrong_by(truth), photo(truth)
    first = refine_map(start, image, PATTERN).map.q
    flipped = np.ascontiguousarray(start.q.swapaxes(0, 1)[..., ::-1])
    second = refine_map(CorrespondenceMap(flipped, "t"), image.T.copy(), turned).map.q
    difference = np.abs(second[..., ::-1].swapaxes(0, 1) - first)[8:-8, 8:-8]
    assert np.median(difference) < 2e-3
    assert np.nanmax(difference) < 0.1


def test_bad_input_is_refused_by_name():
    """Oracle: the sentences."""
    truth = coordinates()
    start = wrong_by(truth)
    with pytest.raises(
        InputError, match=r"frame: the image is 100 x 150 pixels and the map 200 x 150"
    ):
        refine_map(start, photo(truth)[:, :100], PATTERN)
    small = PatternImage(np.ones((50, 60), np.float32), 60, 50)
    with pytest.raises(
        InputError, match=r"frame: its coordinates reach from .* has 60 x 50 pixels"
    ):
        refine_map(start, photo(truth), small)
    with pytest.raises(InputError, match="no finite value"):
        refine_map(replace(start, q=np.full_like(start.q, np.nan)), photo(truth), PATTERN)


@pytest.mark.parametrize("shape", [(1, 1), (2, 7), (9, 40), (31, 3)])
def test_images_of_any_size(shape: tuple[int, int]):
    """Oracle: the map's shape; an image smaller than a window moves nothing far."""
    truth = coordinates()[: shape[0], : shape[1]]
    image = photo(coordinates())[: shape[0], : shape[1]]
    start = CorrespondenceMap(truth.astype(np.float32), "frame")
    found = refine_map(start, image, PATTERN)
    assert found.map.q.shape == (*shape, 2)
    assert np.nanmax(np.abs(found.map.q - truth)) < 1


def test_a_stray_coordinate_is_no_reason_to_refuse():
    """Oracle: one pixel of a thousand beyond the pattern; the rest is refined."""
    truth = coordinates()
    start = wrong_by(truth, 0.2)
    start.q[75, 100] = [-40, 900]
    found = refine_map(start, photo(truth), PATTERN)
    assert found.refined > 0.9
