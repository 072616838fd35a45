"""The coupling kept frame by frame against the matrix written out."""

import numpy as np
import pytest

from mitsuba_endo.solve.elimination.coupling import Coupling

V, G = 37, 8


@pytest.fixture
def added() -> tuple[Coupling, np.ndarray]:
    """Three frames that see overlapping parts of a surface, one unknown shared; and their sum."""
    rng = np.random.default_rng(4)
    coupling, dense = Coupling((V, G)), np.zeros((V, G))
    for seen, own in ((slice(0, 20), [0, 1]), (slice(12, 30), [2, 3, 4]), (slice(3, 33), [5, 6])):
        products, chart = np.zeros((V, len(own) + 1)), np.zeros((len(own) + 1, G))
        products[seen] = rng.normal(size=products[seen].shape)
        chart[:, [*own, 7]] = rng.normal(size=(len(own) + 1,) * 2)
        coupling.add(products, chart)
        dense += products @ chart
    return coupling, dense


def test_rows(added: tuple[Coupling, np.ndarray]):
    """Oracle: the sum of dense products; ranges with no, some and all of a frame's vertices."""
    coupling, dense = added
    for rows in (slice(0, 9), slice(9, 25), slice(33, 37), slice(0, V)):
        np.testing.assert_allclose(coupling.rows(rows), dense[rows], atol=1e-12)


@pytest.mark.parametrize("shape", [(G,), (G, 3)])
def test_product(added: tuple[Coupling, np.ndarray], shape: tuple[int, ...]):
    """Oracle: the dense product with a vector and with a matrix."""
    right = np.random.default_rng(5).normal(size=shape)
    np.testing.assert_allclose(added[0] @ right, added[1] @ right, atol=1e-12)


def test_keeps_only_what_a_frame_sees(added: tuple[Coupling, np.ndarray]):
    """Oracle: the vertices and unknowns of every frame by construction."""
    sizes = [part.values.shape for part in added[0].parts]
    assert sizes == [(20, 3), (18, 4), (30, 3)]


def test_a_frame_without_unknowns_adds_nothing():
    """Oracle: all blocks fixed, so that there is no column."""
    coupling = Coupling((V, 0))
    coupling.add(np.zeros((V, 0)), np.zeros((0, 0)))
    assert coupling.rows(slice(2, 5)).shape == (3, 0)
    assert (coupling @ np.zeros(0)).shape == (V,)
