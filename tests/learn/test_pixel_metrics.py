"""Per-pixel metrics against counts done by hand."""

import numpy as np
import pytest

from mitsuba_endo.decoding.network import CHANNELS, read_heads
from mitsuba_endo.learn.compose import Targets
from mitsuba_endo.learn.pixel_metrics import phase_error, pixel_metrics


def _case() -> tuple[np.ndarray, Targets]:
    """Four rows of ten pixels; the last row is not lit. The network is off by 0.02 along u."""
    lattice = np.stack([np.linspace(3, 7, 40).reshape(4, 10), np.full((4, 10), 5.4)])
    lit = np.ones((4, 10), bool)
    lit[3] = False
    code = np.full((4, 10), -1, np.int8)
    code[0, :4] = [0, 1, 2, 2]
    edge = np.zeros((4, 10), bool)
    edge[:, 5] = True
    truth = Targets((lattice * lit).astype(np.float32), lit, code, edge)
    angle = 2 * np.pi * (lattice + np.array([0.02, 0])[:, None, None])
    output = np.zeros((9, 4, 10), np.float32)
    output[0:4:2], output[1:4:2] = 0.3 * np.sin(angle), 0.3 * np.cos(angle)
    output[7:] = -5
    return output, truth


def test_error_wraps():
    """Oracle: 0.02 and 0 periods, whatever whole periods the lattice counts."""
    output, truth = _case()
    error = phase_error(read_heads(output, CHANNELS), truth)[truth.lit]
    np.testing.assert_allclose(error, np.broadcast_to([0.02, 0], error.shape), atol=1e-5)


def test_shares_are_counts():
    """Oracle: counted by hand below."""
    output, truth = _case()
    output[7, :2] = 5  # 20 of 30 lit pixels are accepted,
    output[7, 3, :5] = 5  # and 5 of 10 unlit ones
    output[0:2, 0, 9] *= -1  # one accepted pixel is half a period off
    output[4:7, 0, 0:4] = np.array([[5, 0, 0, 5], [0, 5, 0, 0], [0, 0, 5, 0]])  # 3 of 4 codes
    output[8, :, 5:7] = 5  # all 4 edge pixels and 4 others
    found = pixel_metrics([read_heads(output, CHANNELS)], [truth])
    assert found.coverage == pytest.approx(20 / 30)
    assert found.false_share == pytest.approx(0.5)
    assert found.gross == pytest.approx(1 / 20)
    assert found.code_right == pytest.approx(0.75)
    assert found.edge_recall == 1
    assert found.edge_precision == pytest.approx(0.5)
    # 19 errors of 0.02 and one of 0.48 along u, 20 of zero along v.
    assert found.median == pytest.approx(0.01, abs=0.0101)
    assert found.p95 == pytest.approx(0.02, abs=1e-4)


def test_two_images_are_counted_together():
    """Oracle: a rejected image halves the coverage of the pair."""
    output, truth = _case()
    accepted = output.copy()
    accepted[7] = 5
    heads = [read_heads(image, CHANNELS) for image in (accepted, output)]
    assert pixel_metrics(heads, [truth, truth]).coverage == pytest.approx(0.5)


def test_nothing_accepted_is_no_number():
    """Oracle: no accepted pixel has no error; shares stay defined."""
    output, truth = _case()
    found = pixel_metrics([read_heads(output, CHANNELS)], [truth])
    assert np.isnan(found.median)
    assert found.coverage == 0
