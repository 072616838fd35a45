"""Training images against the pattern's own truth."""

import numpy as np
import pytest

from mitsuba_endo.capture.settings import Effects
from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.learn.compose import Appearance, compose, crop_view
from mitsuba_endo.learn.patterns import TEXELS, grid_texture
from mitsuba_endo.learn.textures import clouds, without_pattern
from mitsuba_endo.learn.views import LATTICE_UNIT, UNLIT
from tests.learn.cached import step_cache

DRY = Appearance(scatter=0, free_path=1, reflectance=0.4, between=0, lamp=0, wet=0, tint=(2, 0.8))
PLAIN = Effects(vignetting=0, defocus=0, speckle_contrast=0, shot=None, gamma=1, colour="gray",
                bits=16)  # fmt: skip


def _grid_of(seed: int) -> CodedGrid:
    """The grid that ``grid_texture(seed)`` draws, rebuilt from its random numbers."""
    rng = np.random.default_rng((seed, 77))
    columns, rows = (int(n) for n in rng.integers(26, 42, 2))
    return CodedGrid(
        width=(columns + 1) * TEXELS, height=(rows + 1) * TEXELS, columns=columns, rows=rows,
        period=float(TEXELS), step=rng.uniform(0.25, 0.32), line=rng.uniform(0.045, 0.08),
        background=rng.uniform(0, 0.06), seed=1000 + seed,
    )  # fmt: skip


def test_texture_is_the_grid():
    """Oracle: CodedGrid's brightness and truth at the same lattice coordinates."""
    texture, grid = grid_texture(7), _grid_of(7)
    rng = np.random.default_rng(0)
    lattice = rng.uniform([3, 3], [grid.columns - 4, grid.rows - 4], (40, 50, 2))
    # Inverse of the grid's own lattice: nodes[0, 0] is column 0, row 0.
    q = lattice * grid.period + grid.nodes[0, 0]
    np.testing.assert_allclose(grid.truth(q).lattice, lattice, atol=1e-9)
    # Between texels a profile of 0.9 texels is off by up to 1 / (8 0.9^2) when interpolated.
    light = texture.at(lattice.astype(np.float32))
    np.testing.assert_allclose(light, grid.brightness(q), atol=0.16)
    np.testing.assert_array_equal(texture.code, grid.code)


def test_texture_s_lines_are_in_place():
    """Oracle: centroids of the light across vertical lines are whole columns; averaging over
    texels widens lines but must not move them."""
    texture = grid_texture(7)
    u = np.arange(-0.4, 0.4001, 0.01, dtype=np.float32)
    for column in (4, 11, 17):
        # Between rows, where no horizontal line is near.
        across = np.stack([column + u, np.full_like(u, 8.5)], -1)[None]
        light = texture.at(across)[0] - texture.at(np.full((1, 1, 2), 8.5, np.float32))[0]
        assert float((light @ u) / light.sum()) == pytest.approx(0, abs=0.002)


def test_upside_down_is_the_same_light():
    """Oracle: the turned texture at p is the texture at the point opposite to p."""
    texture = grid_texture(7)
    last = np.array(texture.code.shape[::-1]) - 1
    lattice = np.random.default_rng(1).uniform(1, last - 1, (30, 40, 2)).astype(np.float32)
    turned = texture.turned()
    opposite = (last - lattice).astype(np.float32)
    np.testing.assert_allclose(turned.at(lattice), texture.at(opposite), atol=1e-3)
    assert turned.code[2, 5] == texture.code[-3, -6]


@pytest.fixture(scope="module")
def composed():
    view = step_cache().view(0)
    return compose(view, grid_texture(3), DRY, PLAIN, np.random.default_rng(5))


def test_truth_has_the_view_s_lattice(composed):
    """Oracle: the formula of the cached view, up to the pattern's random place."""
    truth = composed[1]
    y, x = np.mgrid[:80, :96]
    u = (x - 40) / 10 + 0.02 * y + np.where(x > 60.5, 3.4, 0)
    place = truth.lattice - np.stack([u, (y - 30) / 10])
    for axis in range(2):
        np.testing.assert_allclose(np.ptp(place[axis][truth.lit]), 0, atol=2 * LATTICE_UNIT)
    assert not truth.lit[:, 60:62].any()  # the depth edge mixes two places
    assert not truth.lit[62:, :19].any()  # shadow
    assert truth.lit[:55, :55].all()
    assert truth.edge[:, 59:63].all()
    assert not truth.edge[:, :58].any()


def test_codes_are_the_pattern_s(composed):
    """Oracle: the code table at the rounded lattice, as channels R, S, L; only near nodes."""
    truth = composed[1]
    asked = truth.code >= 0
    node = np.round(truth.lattice[:, asked]).astype(int)
    np.testing.assert_array_equal(truth.code[asked], 1 - grid_texture(3).code[node[1], node[0]])
    away = np.abs(truth.lattice[:, asked] - node)
    assert away.max() < 0.3
    assert set(np.unique(truth.code)) == {-1, 0, 1, 2}


def test_image_is_bright_where_truth_says_line(composed):
    """Oracle: on vertical lines (phase of u zero) the image is far above cells' middles."""
    image, truth = composed
    off = np.abs(truth.lattice - np.round(truth.lattice))
    line = truth.lit & (off[0] < 0.05)
    cell = truth.lit & (off[0] > 0.4) & (off[1] > 0.4)
    assert image.dtype == np.uint16
    assert image[line].mean() > 4 * image[cell].mean()


def test_mirrors_keep_the_pattern_unmirrored():
    """Oracle: in every crop the lattice stays a rigid image of the whole: unit steps, no UNLIT
    pixel gained a coordinate."""
    view = step_cache().view(0)
    dark = (view.lattice[..., 0] == UNLIT).sum()
    seen = set()
    for seed in range(16):
        crop = crop_view(view, 80, np.random.default_rng(seed))
        assert crop.lattice.shape == (160, 160, 2)
        unlit = crop.lattice == UNLIT
        np.testing.assert_array_equal(unlit[..., 0], unlit[..., 1])
        assert unlit[..., 0].sum() <= dark
        du = np.diff(crop.lattice[..., 0].astype(int), axis=1)
        dv = np.diff(crop.lattice[..., 1].astype(int), axis=0)
        seen.add((float(np.sign(np.median(du))), float(np.sign(np.median(dv)))))
    # Columns grow to the right and rows downwards, whichever way the image was turned.
    assert seen == {(1.0, 1.0)}


def test_examples_repeat_by_number():
    """Oracle: equality of every tensor; another number or seed differs."""
    pytest.importorskip("torch")
    from mitsuba_endo.learn.examples import TrainingExamples

    cache = step_cache()
    examples = TrainingExamples(cache, 64, seed=2, first=0, count=8)
    later = TrainingExamples(cache, 64, seed=2, first=5, count=3)
    for name, tensor in examples[6].items():
        np.testing.assert_array_equal(tensor, later[1][name])
    assert not np.array_equal(examples[6]["image"], examples[5]["image"])
    other = TrainingExamples(cache, 64, seed=3, first=0, count=8)
    assert not np.array_equal(examples[6]["image"], other[6]["image"])


def test_pictures_without_a_pattern():
    """Oracle: every kind is finite, not negative, and of the asked size."""
    for seed in range(20):
        picture = without_pattern((48, 64), np.random.default_rng(seed))
        assert picture.shape == (48, 64)
        assert np.isfinite(picture).all()
        assert picture.min() >= 0


def test_clouds_are_normal_numbers():
    """Oracle: zero mean, unit variance, and neighbours alike over the grain."""
    field = clouds((90, 120), 12.0, np.random.default_rng(0))
    assert abs(float(field.mean())) < 1e-4
    assert float(field.std()) == pytest.approx(1, abs=1e-3)
    near = float((field[:, 1:] * field[:, :-1]).mean())
    far = float((field[:, 40:] * field[:, :-40]).mean())
    assert near > 0.9 > 0.5 > abs(far)
