"""The coded grid's picture against its truth."""

import numpy as np
import pytest

from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.errors import InputError
from mitsuba_endo.rendering.pattern import make_pattern

GRID = CodedGrid(width=150, height=101, columns=14, rows=9, period=10.0, seed=2, step=0.3)


def _peak(grid: CodedGrid, x: float, row_y: float) -> float:
    """Height of the horizontal line above its row at ``x``, in periods, found in the light."""
    y = row_y + np.linspace(-0.45, 0.45, 901) * grid.period
    light = grid.brightness(np.stack([np.full_like(y, x), y], -1)) - grid.background
    return float((row_y - (light @ y) / light.sum()) / grid.period)


def test_steps_are_the_code():
    """Oracle: centroids of the light left and right of inner nodes, extrapolated to the node."""
    for i in range(1, 8):
        for j in range(1, 13):
            x, y = GRID.nodes[i, j]
            left = 2 * _peak(GRID, x - 3, y) - _peak(GRID, x - 6, y)
            right = 2 * _peak(GRID, x + 3, y) - _peak(GRID, x + 6, y)
            assert right - left == pytest.approx(0.3 * GRID.code[i, j], abs=0.01)
            assert left + right == pytest.approx(0, abs=0.01)  # the node is in the middle


def test_nodes_and_phase():
    """Oracle: nodes lie one period apart around the pattern's middle, where phases are zero."""
    nodes = GRID.nodes
    np.testing.assert_allclose(nodes.mean((0, 1)), [74.5, 50.0])
    np.testing.assert_allclose(np.diff(nodes[..., 0], axis=1), 10)
    truth = GRID.truth(nodes)
    np.testing.assert_allclose(truth.phase, 0, atol=1e-9)
    np.testing.assert_array_equal(truth.code, GRID.code)
    np.testing.assert_array_equal(truth.node[3, 5], [5, 3])
    beside = GRID.truth(nodes[3, 5] + np.array([2.5, -4.0]))
    np.testing.assert_allclose(beside.phase, 2 * np.pi * np.array([0.25, -0.4]))
    np.testing.assert_allclose(beside.lattice, [5.25, 2.6])
    outside = GRID.truth(np.array([1.0, 50.0]))
    assert np.isnan(outside.phase).all()
    assert outside.node.tolist() == [-1, -1]


def test_vertical_lines_are_continuous_and_end_with_the_grid():
    """Oracle: full brightness along a line, background half a period past its ends."""
    y = np.arange(5.0, 95.01, 0.25)  # first row 10, last 90, half a period beyond
    line = np.stack([np.full_like(y, GRID.nodes[0, 4, 0]), y], -1)
    np.testing.assert_allclose(GRID.brightness(line), 1)
    ends = GRID.brightness(np.array([[GRID.nodes[0, 4, 0], 1.0], [2.0, 50.0]]))
    np.testing.assert_allclose(ends, GRID.background, atol=1e-3)


@pytest.mark.parametrize("size", [(75, 51), (150, 101), (301, 222), (612, 400)])
def test_texture_of_any_resolution(size):
    """Oracle: the mean of the light over the pattern; the vertical lines' centroids."""
    texture = GRID.texture(*size)
    assert texture.shape == size[::-1]
    fine = GRID.texture(1500, 1010)
    assert texture.mean() == pytest.approx(fine.mean(), rel=0.01)
    x = (np.arange(size[0]) + 0.5) * 150 / size[0] - 0.5
    rows = (np.arange(size[1]) + 0.5) * 101 / size[1] - 0.5
    profile = texture[(rows > 42) & (rows < 58)].min(0) - GRID.background  # between the steps
    near = np.abs(x - GRID.nodes[0, 6, 0]) < 5
    assert profile[near] @ x[near] / profile[near].sum() == pytest.approx(
        GRID.nodes[0, 6, 0], abs=0.25
    )


def test_zero_order_spot():
    """Oracle: a Gaussian on top of the same grid, in the middle of the pattern."""
    spot = CodedGrid(width=150, height=101, columns=14, rows=9, period=10.0, seed=2, step=0.3,
                     zero_order=3.0, zero_order_size=2.0)  # fmt: skip
    q = np.array([[74.5, 50.0], [76.5, 50.0], [74.5, 47.0], [20.0, 20.0]])
    more = spot.brightness(q) - GRID.brightness(q)
    np.testing.assert_allclose(more, 3 * np.exp([0, -0.5, -1.125, -400]), atol=1e-9)


@pytest.mark.parametrize(("flip_x", "flip_y", "sign"), [(1, 1, 1), (1, 0, -1), (0, 1, -1)])
def test_views_of_the_pattern(flip_x, flip_y, sign, monkeypatch):
    """Oracle: the light itself, turned or mirrored, is that of the code read backwards.

    Upside down every step keeps its sense; in a mirror R and L change places.
    """
    q = np.random.default_rng(0).uniform([0, 0], [149, 100], (4000, 2))
    seen = np.where([flip_x, flip_y], [149.0, 100.0] - q, q)
    light = GRID.brightness(seen)
    assert np.abs(GRID.brightness(q) - light).mean() > 0.05
    code = GRID.code[:: -1 if flip_y else 1, :: -1 if flip_x else 1] * sign
    monkeypatch.setattr(CodedGrid, "code", property(lambda _: code))
    np.testing.assert_allclose(GRID.brightness(q), light, atol=1e-12)


def test_scenes_can_ask_for_it():
    """Oracle: the same grid as an object; mistakes are named."""
    image = make_pattern("coded", width="150", height="101", columns="14", rows="9", period="10",
                         seed="2", step="0.3", oversample="1", colour="white")  # fmt: skip
    np.testing.assert_array_equal(image[..., 0], GRID.texture(150, 101))
    with pytest.raises(InputError, match="step"):
        make_pattern("coded", step=0.7)
    with pytest.raises(InputError, match="fewer lines"):
        make_pattern("coded", columns=80, rows=80)
