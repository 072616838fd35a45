"""Distances between picked points, and what is said about their errors."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.records.calibration import Calibration, SurfaceEstimate
from mitsuba_endo.show.measure import SurfacePoint, distance, pick
from mitsuba_endo.solve.calibrate import calibrate
from tests.rigs import with_noise
from tests.solve.monte_carlo import FIELD
from tests.solve.problems import NOISE, PROJECTION_MODELS, map_of, rig_file, small_rig


@pytest.fixture(scope="module")
def calibration(make_calibration: Callable[..., Calibration]) -> Calibration:
    return make_calibration(width=64, height=46)


def _sheet(calibration: Calibration, seed: int = 5) -> SurfaceEstimate:
    """The sheet with modes that make up a part of its standard deviation."""
    surface = calibration.surface
    assert surface.std is not None
    rng = np.random.default_rng(seed)
    modes = rng.normal(size=(1, 3)) * surface.std[:, None] * [0.5, 0.2, 0.3] / 2
    return replace(surface, modes=modes)


def _picked(surface: SurfaceEstimate, x: float, y: float) -> SurfacePoint:
    point = pick(surface, np.zeros(3), np.array([x, y, 1.0]))
    assert point is not None
    return point


def test_picked_point_lies_on_ray_and_surface(calibration: Calibration):
    """Oracle: the formula of the sheet, of which triangles miss the middle by their sagitta; the
    nearer of two sheets; a miss is None."""
    surface = calibration.surface
    origin, direction = np.array([2.0, -3.0, 1.0]), np.array([0.13, -0.21, 1.0])
    point = pick(surface, origin, direction)
    assert point is not None
    x, y, z = point.position
    np.testing.assert_allclose(np.cross(point.position - origin, direction), 0, atol=1e-9)
    expected = 70 - (x**2 + y**2) / 260 + 4 * np.sin(x / 6) * np.cos(y / 8)
    expected += 6 * np.exp(-((x - 8) ** 2 + (y + 5) ** 2) / 60)
    assert z == pytest.approx(expected, abs=0.02)
    assert point.weights.sum() == pytest.approx(1)
    vertices = np.concatenate([surface.vertices, surface.vertices + np.array([0, 0, 20])])
    double = SurfaceEstimate(
        vertices, np.concatenate([surface.faces + len(surface.vertices), surface.faces])
    )
    both = pick(double, origin, direction)
    assert both is not None
    np.testing.assert_allclose(both.position, point.position)
    assert pick(surface, origin, -direction) is None
    assert pick(surface, origin, np.array([9.0, 0.1, 1.0])) is None


def test_std_agrees_with_simulated_errors(calibration: Calibration):
    """Oracle: the scatter of the distance over 20000 draws of what is assumed: common modes, an
    error of each end's own, and one of the unit."""
    surface = _sheet(calibration)
    assert surface.std is not None
    assert surface.modes is not None
    a, b = _picked(surface, -0.3, 0.2), _picked(surface, 0.25, -0.11)
    found = distance(surface, a, b, scale_std_percent=0.2)
    rng = np.random.default_rng(1)
    n = 20000
    common = rng.normal(size=(n, 3))
    own = np.sqrt(surface.std**2 - (surface.modes**2).sum(1))
    ends = []
    for point in (a, b):
        vertices = surface.vertices[point.vertices]
        rays = vertices / np.linalg.norm(vertices, axis=1)[:, None]
        shift = common @ surface.modes[point.vertices].T
        shift = shift + rng.normal(size=(n, 1)) * own[point.vertices]
        ends.append(np.einsum("k,nkc->nc", point.weights, vertices + shift[..., None] * rays))
    unit = 1 + 0.002 * rng.normal(size=n)
    drawn = np.linalg.norm(ends[0] - ends[1], axis=1) * unit
    assert found.correlated
    assert found.value == pytest.approx(drawn.mean(), rel=1e-4)
    assert found.std == pytest.approx(drawn.std(), rel=0.03)


def test_without_modes_it_is_the_widest(calibration: Calibration):
    """Oracle: standard deviations along the rays with any correlation of the ends, searched."""
    surface = calibration.surface
    assert surface.std is not None
    a, b = _picked(surface, -0.3, 0.2), _picked(surface, 0.25, -0.11)
    found = distance(surface, a, b)
    along = (a.position - b.position) / found.value
    own = [
        p.weights @ surface.std[p.vertices] * (p.position / np.linalg.norm(p.position) @ along)
        for p in (a, b)
    ]
    stds = [np.sqrt(own[0] ** 2 + own[1] ** 2 - 2 * r * own[0] * own[1]) for r in (-1, 0, 1)]
    assert not found.correlated
    assert found.std == pytest.approx(max(stds), rel=1e-3)


def test_words(calibration: Calibration):
    """Oracle: two digits of the half interval; the unit, or that there is none."""
    surface, solution = _sheet(calibration), calibration.solution
    found = distance(surface, _picked(surface, -0.3, 0.2), _picked(surface, 0.25, -0.11))
    assert found.std is not None
    half = 1.96 * found.std
    assert found.words(solution) == f"{found.value:.3f} ± {half:.3f} mm (95 %)"
    unscaled = solution.model_copy(update={"units": "baseline", "scale": "up_to_scale"})
    assert found.words(unscaled).endswith("first baselines (up to scale) (95 %)")
    bare = replace(surface, std=None, modes=None)
    a = _picked(bare, -0.3, 0.2)
    assert distance(bare, a, _picked(bare, 0.2, 0)).words(solution).endswith("no interval known")
    assert distance(bare, a, a).value == 0


@pytest.mark.slow
@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("law", PROJECTION_MODELS)
def test_interval_covers_the_truth(law: str):
    """Oracle: the truth of a ray-cast sheet whose noise is drawn 24 times; distances between
    points anywhere.

    The statement is cautious (the jackknife's surplus, errors inside a triangle taken as one), so
    the scatter is smaller than stated, but not by more than twice.
    """
    rig = small_rig(law, FIELD)
    rng = np.random.default_rng(0)
    seen = np.argwhere(np.isfinite(rig.depth) & np.isfinite(rig.q).all(-1))[:, ::-1]
    pixels = seen[rng.integers(len(seen), size=(24, 2))]
    rays = rig.camera.rays(pixels.astype(float))
    ends = rays * rig.depth[pixels[..., 1], pixels[..., 0]][..., None]
    truth = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=-1)
    lengths, stds = np.full((2, 24, len(pixels)), np.nan)
    for seed in range(24):
        surface = calibrate([map_of(with_noise(rig, NOISE, seed))], rig_file(rig)).surface
        for i, (a, b) in enumerate(rays):
            picked = pick(surface, np.zeros(3), a), pick(surface, np.zeros(3), b)
            if picked[0] is not None and picked[1] is not None:
                found = distance(surface, picked[0], picked[1])
                lengths[seed, i], stds[seed, i] = found.value, found.std
    known = np.isfinite(lengths).all(0)
    assert known.sum() > 15
    error, std = (lengths - truth)[:, known], stds[:, known]
    assert (np.abs(error) < 1.96 * std).mean() > 0.95
    scatter = np.sqrt(lengths[:, known].var(0, ddof=1).mean() / (std**2).mean())
    assert 0.5 < scatter < 1.1
