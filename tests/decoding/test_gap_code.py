"""The code of the grid: claims are checked by listing all windows."""

import time

import numpy as np
import pytest

from mitsuba_endo.decoding.gap_code import gap_code, letters, window_distance
from mitsuba_endo.errors import InputError


def _windows(code: np.ndarray, size: int = 3) -> list[str]:
    """Every window of the code as a string, read row by row."""
    rows, columns = code.shape
    return [
        str(code[i : i + size, j : j + size].ravel().tolist())
        for i in range(rows - size + 1)
        for j in range(columns - size + 1)
    ]


@pytest.mark.parametrize("shape", [(32, 32), (24, 40), (3, 3), (48, 48)])
@pytest.mark.parametrize("seed", [0, 1, 7])
def test_every_neighbourhood_is_unique(shape, seed):
    """Oracle: a list of all windows, upright and upside down, in which nothing may repeat."""
    code = gap_code(*shape, seed)
    assert code.shape == shape
    assert set(np.unique(code)) <= {-1, 0, 1}
    both = _windows(code) + _windows(code[::-1, ::-1])
    assert len(set(both)) == len(both)


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_mirrored_patterns_are_different(seed):
    """Oracle: all windows of the pattern in a mirror, where R and L change places."""
    code = gap_code(32, 32, seed)
    own = set(_windows(code) + _windows(code[::-1, ::-1]))
    for mirrored in (-code[:, ::-1], -code[::-1]):
        assert not own & set(_windows(mirrored))


def test_seeds_repeat_and_differ():
    """Oracle: a fresh search with the same seed; another seed; all three codes are used evenly."""
    first = gap_code(32, 32, 3).copy()
    gap_code.cache_clear()
    start = time.process_time()
    np.testing.assert_array_equal(gap_code(32, 32, 3), first)
    assert time.process_time() - start < 1
    assert (gap_code(32, 32, 4) != first).mean() > 0.5
    for c in (-1, 0, 1):
        assert 0.25 < (first == c).mean() < 0.42


def test_distance_of_windows():
    """Oracle: brute force over pairs on a small code; the design's 4 to 6 on the full one."""
    code = gap_code(9, 11, 2)
    upright = [w.ravel() for i in range(5) for w in [code[i : i + 5, j : j + 5] for j in range(7)]]
    least = 25
    for a, one in enumerate(upright):
        for b, other in enumerate(upright):
            least = min(least, (one != other[::-1]).sum(), 25 if a == b else (one != other).sum())
    assert window_distance(code) == least
    assert 4 <= window_distance(gap_code(32, 32)) <= 6
    assert window_distance(gap_code(32, 32), 3) == 1


def test_letters():
    """Oracle: the definition: R = 1, S = 0, L = -1."""
    assert letters(np.array([[1, 0], [-1, 1]], np.int8)) == ["RS", "LR"]


def test_too_many_lines():
    """Oracle: 3^9 windows, four views each, cannot serve 80 x 80 nodes."""
    with pytest.raises(InputError, match="take fewer lines"):
        gap_code(80, 80)
