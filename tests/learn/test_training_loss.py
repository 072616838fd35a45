"""The loss against formulas and finite differences."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from mitsuba_endo.learn.training_loss import EDGE_BALANCE, losses, phase_chord  # noqa: E402


def _truth(seed: int = 0):
    rng = np.random.default_rng(seed)
    shape = (2, 5, 7)
    return {
        "image": torch.zeros(2, 2, 5, 7),
        "lattice": torch.from_numpy(rng.uniform(-3, 9, (2, 2, 5, 7))),
        "lit": torch.from_numpy(rng.random(shape) < 0.7),
        "code": torch.from_numpy(rng.integers(-1, 3, shape).astype(np.int8)),
        "edge": torch.from_numpy(rng.random(shape) < 0.2),
    }


def _output(truth, turn: float):
    """Network output whose phases are off by ``turn`` periods, of various lengths."""
    angle = 2 * torch.pi * (truth["lattice"] + turn)
    waves = torch.stack([angle.sin(), angle.cos()], 2).flatten(1, 2) * 1.7
    rest = torch.zeros(2, 5, 5, 7, dtype=waves.dtype)
    return torch.cat([waves, rest], 1)


@pytest.mark.parametrize("turn", [0.02, 0.1, 0.5])
def test_phase_is_the_chord(turn):
    """Oracle: 2 sin(pi turn), the chord of an arc of ``turn`` periods, at any vector length."""
    truth = _truth()
    chord = phase_chord(_output(truth, turn)[:, :4], truth["lattice"])
    assert chord.shape == (2, 2, 5, 7)
    np.testing.assert_allclose(chord, 2 * np.sin(np.pi * turn), atol=1e-5)
    loss = losses(_output(truth, turn), truth).phase
    assert float(loss) == pytest.approx(2 * np.sin(np.pi * turn), abs=1e-5)


def test_even_logits():
    """Oracle: log 3 for three even codes; log 2 for even odds, edges counted EDGE_BALANCE times."""
    truth = _truth()
    found = losses(_output(truth, 0.3), truth)
    assert float(found.code) == pytest.approx(np.log(3))
    assert float(found.confidence) == pytest.approx(np.log(2))
    edges = float(truth["edge"].double().mean())
    expected = np.log(2) * (1 + (EDGE_BALANCE - 1) * edges)
    assert float(found.edge) == pytest.approx(expected)


def test_confidence_wants_right_lit_pixels():
    """Oracle: confident everywhere costs nothing exactly where phases are right and lit."""
    truth = _truth()
    truth["lit"][:] = True
    right, wrong = _output(truth, 0.05), _output(truth, 0.15)
    right[:, 7] = wrong[:, 7] = 20.0
    assert float(losses(right, truth).confidence) < 1e-6
    assert float(losses(wrong, truth).confidence) == pytest.approx(20)


def test_gradient():
    """Oracle: central differences of the whole loss in double precision."""
    truth = _truth()
    rng = np.random.default_rng(4)
    output = torch.from_numpy(rng.normal(size=(2, 9, 5, 7))).requires_grad_()
    losses(output, truth).total.backward()
    gradient = output.grad
    assert gradient is not None
    h = 1e-6
    for place in [(0, 0, 1, 2), (1, 3, 4, 6), (0, 5, 2, 2), (1, 7, 0, 3), (0, 8, 3, 3)]:
        values = []
        for sign in (1, -1):
            moved = output.detach().clone()
            moved[place] += sign * h
            values.append(float(losses(moved, truth).total))
        assert float(gradient[place]) == pytest.approx((values[0] - values[1]) / (2 * h), abs=1e-7)


def test_nothing_lit_is_finite():
    """Oracle: an image without a grid teaches confidence and edges only."""
    truth = _truth()
    truth["lit"][:] = False
    truth["code"][:] = -1
    output = _output(truth, 0.2).requires_grad_()
    found = losses(output, truth)
    assert found.phase.item() == 0
    assert found.code.item() == 0
    found.total.backward()
    assert torch.isfinite(output.grad).all()
