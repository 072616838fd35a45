"""The grid's decoder behind the network: what it says of outputs whose errors are known."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.decoding.grid.decode import DecodedGrid, decode_heads
from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.decoding.network import CHANNELS, read_heads
from mitsuba_endo.errors import InputError
from tests.decoding.grid_views import HEIGHT, WIDTH, view
from tests.decoding.heads import Errors, depth_edges, network_output

PATTERN = CodedGrid()
FALSE = 0.01
"""Share of the pixels that an image without this pattern may get."""


def _decode(output: NDArray[np.float32], pattern: CodedGrid = PATTERN) -> DecodedGrid:
    return decode_heads(read_heads(output, CHANNELS), pattern)


def _errors(decoded: DecodedGrid, q: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return errors (K, 2) in periods off the depth edges, and the coverage there."""
    lattice = PATTERN.truth(q).lattice
    judged = np.isfinite(lattice[..., 0]) & ~depth_edges(lattice)
    found = judged & np.isfinite(decoded.q[..., 0])
    return np.abs(decoded.q - q)[found] / PATTERN.period, found.sum() / judged.sum()


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(
    ("shape", "coverage", "wrong"), [("sheet", 0.95, 0.0), ("colon", 0.85, 0.015)]
)
def test_coordinates(llvm, shape: str, coverage: float, wrong: float, turned: bool):
    """Oracle: the view's exact coordinates, also with the pattern upside down.

    The noise put in is 0.015 periods, whose median absolute value is 0.010.
    """
    q = view(shape)
    # Upside down, the network still lets phases grow to the right and down.
    q = q[::-1, ::-1] if turned else q
    output = network_output(q, PATTERN, Errors())
    if turned:
        output[[0, 2]] *= -1
    decoded = _decode(output)
    assert not decoded.reason
    error, share = _errors(decoded, q)
    assert np.median(error) < 0.012
    assert np.quantile(error, 0.95) < 0.05
    assert (error.max(1) > 0.5).mean() <= wrong
    assert share > coverage
    assert decoded.assignment.turn == (-1 if turned else 1)


def test_what_is_not_lit_stays_unknown(llvm):
    """Oracle: pixels to which the exact view gives no coordinate; confidence is 0 there."""
    q = view("colon")
    decoded = _decode(network_output(q, PATTERN, Errors()))
    unlit = ~np.isfinite(q[..., 0])
    assert unlit.mean() > 0.02
    assert np.isnan(decoded.q[unlit]).all()
    assert (decoded.confidence[unlit] == 0).all()
    assert (decoded.confidence[np.isfinite(decoded.q[..., 0])] > 0.5).all()


def test_folds_are_not_bridged(llvm):
    """Oracle: exact coordinates, with most depth edges unseen and the phase blurred over them."""
    worst = []
    for seed in range(3):
        q = view("colon", seed)
        decoded = _decode(network_output(q, PATTERN, Errors(missed=0.6, blur=2.0), seed))
        error, share = _errors(decoded, q)
        assert share > 0.7
        worst.append((error.max(1) > 0.5).mean())
    assert np.mean(worst) < 0.015


def test_misread_codes_and_holes(llvm):
    """Oracle: exact coordinates; one code in six is wrong, and a tenth of the image is blind."""
    q = view("sheet")
    errors = Errors(flips=0.16, holes=0.1, phase=0.03)
    decoded = _decode(network_output(q, PATTERN, errors))
    error, share = _errors(decoded, q)
    assert (error.max(1) > 0.5).mean() < 0.001
    assert share > 0.7
    assert decoded.assignment.codes_right == pytest.approx(0.84, abs=0.05)


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("shape", ["sheet", "colon"])
def test_another_code_is_refused(llvm, shape: str, seed: int):
    """Oracle: the pattern was another one, so every accepted pixel is invented."""
    output = network_output(view(shape), CodedGrid(seed=seed), Errors(flips=0.02), seed)
    decoded = _decode(output)
    assert decoded.coverage < FALSE
    assert "code" in decoded.reason


@pytest.mark.parametrize("axis", [1, 2])
@pytest.mark.parametrize("shape", ["sheet", "colon"])
def test_a_mirrored_grid_is_refused(llvm, shape: str, axis: int):
    """Oracle: no surface shows the pattern mirrored. Its lines and steps do look like a grid's."""
    output = np.flip(network_output(view(shape), PATTERN, Errors(flips=0.02)), axis).copy()
    output[0 if axis == 2 else 2] *= -1
    output[[4, 6]] = output[[6, 4]]
    assert _decode(output).coverage < FALSE


def test_a_grid_without_steps_is_refused(llvm):
    """Oracle: every code is read as S, with conviction."""
    output = network_output(view("sheet"), PATTERN, Errors())
    output[4:7] = np.array([0.0, 6.0, 0.0])[:, None, None]
    decoded = _decode(output)
    assert decoded.coverage < FALSE
    assert "code" in decoded.reason


def test_a_grid_without_legible_code_is_refused(llvm):
    """Oracle: codes drawn by lot, node by node."""
    output = network_output(view("sheet"), PATTERN, Errors(flips=2 / 3))
    assert _decode(output).coverage < FALSE


@pytest.mark.parametrize("confident", [False, True])
def test_noise_is_refused(confident: bool):
    """Oracle: heads drawn by lot, pixel by pixel, hold no grid; confidence or not."""
    output = np.random.default_rng(0).standard_normal((9, HEIGHT, WIDTH)).astype(np.float32)
    if confident:
        output[7:9] = np.array([4.0, -4.0])[:, None, None]
    decoded = _decode(output)
    assert decoded.coverage == 0
    assert decoded.reason == "no grid was found"


def test_an_image_without_any_node():
    """Oracle: heads of a black image, without confidence anywhere."""
    output = np.zeros((9, 48, 80), np.float32)
    output[[1, 3]] = 1
    output[7] = -4
    decoded = _decode(output)
    assert decoded.coverage == 0
    assert decoded.q.shape == (48, 80, 2)


def test_channels_by_name(llvm):
    """Oracle: the same map from outputs in another order; a missing one is named."""
    output = network_output(view("sheet"), PATTERN, Errors())
    order = [8, 3, 0, 5, 1, 7, 2, 6, 4]
    shuffled = read_heads(output[order], [CHANNELS[k] for k in order])
    expected = _decode(output).q
    np.testing.assert_array_equal(decode_heads(shuffled, PATTERN).q, expected)
    with pytest.raises(InputError, match="code_S is missing"):
        read_heads(output[:8], ["edge", *CHANNELS[:5], *CHANNELS[6:8]])


def test_other_pattern_sizes(llvm):
    """Oracle: exact coordinates in a pattern of other size, period and count of lines."""
    other = CodedGrid(width=480, height=384, columns=25, rows=22, period=15.0, seed=4)
    q = view("sheet")
    decoded = _decode(network_output(q, other, Errors()), other)
    inside = np.isfinite(other.truth(q).lattice[..., 0])
    found = np.isfinite(decoded.q[..., 0])
    error = np.abs(decoded.q - q)[found] / other.period
    assert (found & inside).sum() > 0.9 * inside.sum()
    assert np.quantile(error, 0.99) < 0.1
