"""The refinement's parts against direct computation."""

import numpy as np
import pytest

from mitsuba_endo.refine.alternative_shifts import alternative_shifts
from mitsuba_endo.refine.cells import SIDE, Links, blend, mean, padded
from mitsuba_endo.refine.folds import find_links
from mitsuba_endo.refine.pattern_image import grid_image
from mitsuba_endo.refine.regression import COLUMNS, Ridges, normal_equations, solve
from mitsuba_endo.refine.smoother import Smoother
from mitsuba_endo.refine.windows import REACH, Windows
from tests.refine.views import GRID, coordinates

H, W = 9, 13
RNG = np.random.default_rng(0)


def _links(torn: float = 0.0) -> Links:
    rng = np.random.default_rng(5)
    return Links(rng.random((H, W - 1)) >= torn, rng.random((H - 1, W)) >= torn)


def _window(links: Links, sigma: float, row: int, column: int) -> np.ndarray:
    """Return a window's weights (H, W) by walking along the column and from there along rows."""
    reach = int(np.ceil(REACH * sigma / SIDE))
    out = np.zeros((H, W))
    for y in _walk(links.down[:, column], row, reach):
        for x in _walk(links.right[y], column, reach):
            away = SIDE**2 * ((x - column) ** 2 + (y - row) ** 2)
            out[y, x] = np.exp(-away / (2 * sigma**2))
    return out


def _walk(link: np.ndarray, start: int, reach: int) -> list[int]:
    """Return the places of a line that can be reached from ``start``."""
    found = [start]
    for step in (1, -1):
        at = start
        while abs(at + step - start) <= reach and 0 <= at + step <= len(link):
            if not link[min(at, at + step)]:
                break
            at += step
            found.append(at)
    return found


@pytest.mark.parametrize("torn", [0.0, 0.3])
def test_windows_are_sums_over_what_can_be_reached(torn: float):
    """Oracle: windows walked cell by cell, and their moments summed in plain loops."""
    links, sigma = _links(torn), 5.0
    fields = [RNG.random((H, W)).astype(np.float32) for _ in range(3)]
    m = Windows(links, sigma).moments([fields[0]], [fields[1]], [fields[2]])
    y, x = np.mgrid[:H, :W]
    for row, column in ((0, 0), (4, 6), (8, 12), (3, 11), (7, 2)):
        window, at = _window(links, sigma, row, column), row * W + column
        dx, dy = SIDE * (x - column), SIDE * (y - row)
        expected = {
            (0, 0, 0): window * fields[0], (1, 1, 0): window * fields[1] * dx,
            (1, 0, 1): window * fields[1] * dy, (2, 0, 0): window * fields[2],
            (2, 2, 0): window * fields[2] * dx**2, (2, 1, 1): window * fields[2] * dx * dy,
            (2, 0, 2): window * fields[2] * dy**2,
        }  # fmt: skip
        for (degree, a, b), value in expected.items():
            assert m.of(degree, 0, a, b)[at] == pytest.approx(value.sum(), rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("torn", [0.0, 0.3])
def test_interpolation_keeps_what_is_linear(torn: float):
    """Oracle: the linear field, right up to folds and borders."""
    links = _links(torn)
    y, x = np.mgrid[: H * SIDE, : W * SIDE].astype(np.float32)
    field = np.stack([2 + 0.7 * x - 0.3 * y, 5 - 0.1 * x + 1.3 * y], -1)
    middle = field[SIDE // 2 :: SIDE, SIDE // 2 :: SIDE]
    slope = np.broadcast_to(np.array([[0.7, -0.3], [-0.1, 1.3]], np.float32), (H, W, 2, 2))
    np.testing.assert_allclose(blend(middle, links, slope), field, atol=1e-4)


def test_interpolation_stops_at_a_fold():
    """Oracle: two halves that differ by 10 keep their own values up to the fold between them."""
    right = np.ones((H, W - 1), bool)
    right[:, 5] = False
    value = np.zeros((H, W, 1), np.float32)
    value[:, 6:] = 10
    out = blend(value, Links(right, np.ones((H - 1, W), bool)))
    np.testing.assert_allclose(out[:, 6 * SIDE :], 10, rtol=1e-6)
    assert (out[:, : 6 * SIDE] == 0).all()


def test_smoothing_keeps_quadratics_and_fills_holes():
    """Oracle: the field itself, without noise."""
    y, x = np.mgrid[: 30 * SIDE, : 40 * SIDE].astype(np.float32)
    field = (0.9 * x - 0.2 * y + 0.004 * (x - 50) ** 2 - 0.003 * (y - 30) * (x - 50))[..., None]
    known = np.ones(x.shape, np.float32)
    known[40:45, 50:56] = 0
    links = Links(np.ones((30, 39), bool), np.ones((29, 40), bool))
    smooth = Smoother(Windows(links, 6.0), links, known).pixels(field * known[..., None])
    inside = (slice(15, -15), slice(15, -15))
    assert np.abs(smooth - field)[inside].max() < 0.05


def test_one_regression_against_least_squares():
    """Oracle: NumPy's least squares on the same columns, weights and window."""
    links = Links(np.ones((H, W - 1), bool), np.ones((H - 1, W), bool))
    sigma, shape = 6.0, (H * SIDE, W * SIDE)
    T, Tu, Tv, weight = (RNG.random(shape).astype(np.float32) for _ in range(4))
    y, x = np.mgrid[: shape[0], : shape[1]]
    light = (0.8 * T + 0.8 * (0.05 * Tu - 0.03 * Tv) + 0.1 + 0.001 * x).astype(np.float32)
    light += 0.01 * RNG.standard_normal(shape).astype(np.float32)
    fit = solve(
        normal_equations(Windows(links, sigma), weight, [T, Tu, Tv, light]), Ridges(0, 0), 1e-3
    )
    row, column = 4, 6
    window = _window(links, sigma, row, column).repeat(SIDE, 0).repeat(SIDE, 1)
    root = np.sqrt(window * weight).ravel()
    dx, dy = ((SIDE * (c // SIDE - at)).astype(float) for c, at in ((x, column), (y, row)))
    fields = (np.ones(shape), T, Tu, Tv)
    columns = [(fields[f] * dx**a * dy**b).ravel() * root for f, a, b in COLUMNS[:-1]]
    design = np.stack(columns, -1)
    solution = np.linalg.lstsq(design, light.ravel() * root, rcond=None)[0]
    at = row * W + column
    np.testing.assert_allclose(fit.shift[at] * fit.gain[at], solution[6:], atol=1e-4)
    information = np.linalg.inv(np.linalg.inv(design.T @ design)[6:, 6:]) / SIDE**2
    expected = np.array([information[0, 0], information[0, 1], information[1, 1]])
    np.testing.assert_allclose(fit.information[at], expected * fit.gain[at] ** 2, rtol=1e-3)


def test_tears_are_found_also_over_a_gap():
    """Oracle: the fold's place; the same view without it has no tear."""
    for fold in (False, True):
        q = coordinates(fold=fold).astype(np.float32)
        q[:, 98:103] = np.nan
        links = find_links(padded(q, np.nan))
        torn = ~links.right[:, 30:36].all(1)
        assert torn.all() if fold else not torn.any()
        assert links.right[:, :30].all()
        assert links.down.all() or fold


def test_alternatives_in_the_grid_lie_a_period_away():
    """Oracle: the grid's period, 12, along both axes and diagonals."""
    shifts = {tuple(s) for s in alternative_shifts(grid_image(GRID)).tolist()}
    assert shifts == {(12 * i, 12 * j) for i in (-1, 0, 1) for j in (-1, 0, 1)} - {(0, 0)}


def test_a_pattern_is_looked_up_where_it_is():
    """Oracle: the grid's own formula; linear interpolation is right to 1 % but where lines step."""
    q = coordinates().astype(np.float32)
    value, x, y = grid_image(GRID).look_up(q, 0.0)
    off = np.abs(value - GRID.brightness(q))
    assert off.max() < 0.1
    assert np.percentile(off, 95) < 0.015
    step = np.float32(0.25)
    for k, derivative in enumerate((x, y)):
        ahead, behind = (q + s * step * np.eye(2, dtype=np.float32)[k] for s in (1, -1))
        slope = (GRID.brightness(ahead) - GRID.brightness(behind)) / (2 * step)
        assert np.corrcoef(derivative.ravel(), slope.ravel())[0, 1] > 0.97
        assert np.median(np.abs(derivative - slope)) < 0.02


def test_means_over_cells():
    """Oracle: NumPy's mean."""
    field = RNG.random((H * SIDE, W * SIDE)).astype(np.float32)
    expected = field.reshape(H, SIDE, W, SIDE).mean((1, 3))
    np.testing.assert_allclose(mean(field), expected, rtol=1e-5)
