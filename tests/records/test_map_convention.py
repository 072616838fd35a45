"""Maps as other tools count and order them."""

from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import CorrespondenceMap, load_map, load_maps, write_map
from mitsuba_endo.records.map_convention import ORIGINS, WORDS, read_map_convention

SIZE = (480, 384)
PAGE = (Path(__file__).parents[2] / "docs" / "conventions.md").read_text("utf-8")


def truth() -> np.ndarray:
    y, x = np.mgrid[:7, :11].astype(np.float64)
    q = np.stack([40 + 31.3 * x + 0.4 * y, 20 + 42.7 * y - 0.3 * x], -1)
    q[2, 5] = np.nan
    return q


WIDTH, HEIGHT = SIZE
BROUGHT = {
    "": truth(),
    "one-based": truth() + 1,
    "corner-based": truth() + 0.5,
    "normalised": (truth() + 0.5) / SIZE,
    "normalised-centres": truth() / (WIDTH - 1, HEIGHT - 1),
    "normalised,signed": 2 * (truth() + 0.5) / SIZE - 1,
    "swapped": truth()[..., ::-1],
    "x-mirrored": np.stack([WIDTH - 1 - truth()[..., 0], truth()[..., 1]], -1),
    "y-upwards": np.stack([truth()[..., 0], HEIGHT - 1 - truth()[..., 1]], -1),
    "transposed": truth().swapaxes(0, 1),
    "missing=-1": np.nan_to_num(truth(), nan=-1),
    "missing=65535,missing=0": np.where(np.arange(11)[:, None] == 1, 0,
                                        np.nan_to_num(truth(), nan=65535)),
    "one-based,swapped,y-upwards": np.stack(
        [HEIGHT - truth()[..., 1], truth()[..., 0] + 1], -1),
}  # fmt: skip
"""By hand, what each convention makes of the same coordinates."""


@pytest.mark.parametrize("words", BROUGHT)
def test_every_convention_is_read_right(tmp_path: Path, words: str):
    """Oracle: the coordinates from which each was made by hand."""
    np.save(tmp_path / "m.npy", BROUGHT[words])
    q = load_map(tmp_path / "m.npy", read_map_convention(words), SIZE).q
    expected = truth()
    if "missing=0" in words:
        expected[:, 1] = np.nan
    np.testing.assert_allclose(q, expected, atol=1e-3)


def test_every_word_is_tried_and_documented():
    """Oracle: the table of words, and the page."""
    tried = {word for words in BROUGHT for word in words.split(",")}
    assert tried >= set(WORDS) - {"zero-based"}
    assert set(ORIGINS) <= set(WORDS)
    for word in (*WORDS, "missing=VALUE", "channels=X/Y"):
        assert f"`{word}`" in PAGE, word


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("one-based,zero-based", "contradicts"),
        ("upside-down", "upside-down"),
        ("missing=none", "missing=none"),
        ("channels=X", "channels=X"),
        ("signed", "normalised coordinates"),
    ],
)
def test_bad_words(words: str, named: str):
    """Oracle: the word that is wrong is named."""
    with pytest.raises(InputError, match=named):
        read_map_convention(words)


def test_without_the_size():
    """Oracle: the contract: mirrored and normalised coordinates depend on the pattern's size."""
    for words in ("y-upwards", "x-mirrored", "normalised"):
        with pytest.raises(InputError, match="needs the pattern's size"):
            read_map_convention(words).affine(None)


def test_covariances_and_weights_follow(tmp_path: Path):
    """Oracle: by hand: exchanged axes exchange variances, a mirror turns the covariance's sign."""
    covariance = np.tile(np.float32([0.1, 0.02, 0.3]), (7, 11, 1))
    weight = np.linspace(0.1, 1, 77, dtype=np.float32).reshape(7, 11)
    q = np.float32(truth())
    write_map(tmp_path / "m.npz", CorrespondenceMap(q, "m", weight, covariance))
    for words, expected in {
        "swapped": [0.3, 0.02, 0.1],
        "y-upwards": [0.1, -0.02, 0.3],
        "one-based": [0.1, 0.02, 0.3],
    }.items():
        read = load_map(tmp_path / "m.npz", read_map_convention(words), SIZE)
        assert read.covariance is not None
        np.testing.assert_allclose(read.covariance[3, 4], expected, rtol=1e-6)
    read = load_map(tmp_path / "m.npz", read_map_convention("transposed"), SIZE)
    assert read.covariance is not None
    assert read.weight is not None
    assert read.covariance.shape == (11, 7, 3)
    np.testing.assert_array_equal(read.weight, weight.T)


def test_files_of_one_name_are_called_by_their_folders(tmp_path: Path):
    """Oracle: by hand."""
    for folder in "ab":
        (tmp_path / folder).mkdir()
        np.save(tmp_path / folder / "map.npy", truth())
    maps = load_maps([tmp_path / "a" / "map.npy", tmp_path / "b" / "map.npy"])
    assert [map_.name for map_ in maps] == ["a/map.npy", "b/map.npy"]
