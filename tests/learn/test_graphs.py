"""The graph network's examples, training and comparison, on grids whose links are known."""

from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from mitsuba_endo.decode.gap_code import gap_code
from mitsuba_endo.decode.grid.heads import Heads, smoothed
from mitsuba_endo.decode.grid.nodes import find_nodes
from mitsuba_endo.learn.compose import Truth
from mitsuba_endo.learn.graph_curves import (
    METHODS,
    THRESHOLDS,
    Case,
    Curve,
    curves,
    save_comparison,
)
from mitsuba_endo.learn.graph_loop import GraphPlan, joined, train_graph_net
from mitsuba_endo.learn.graphs import labelled_graph

PERIOD = 10
CODE = gap_code(26, 30)
FOLD = 96
"""Column of pixels from which all lies two columns of the pattern further."""


def seen(seed: int, edge: float = 0.6) -> tuple[Heads, Truth]:
    """Return a grid whose phase runs on across a fold, which the edge head half sees."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:120, :180].astype(np.float32)
    slant = rng.uniform(-0.1, 0.1)
    lattice = np.stack([2.3 + (x + slant * y) / PERIOD, 3.4 + (y - slant * x) / PERIOD], -1)
    lattice[:, FOLD:, 0] += 2
    node = np.rint(lattice).astype(int)
    probable = np.eye(3)[1 - CODE[node[..., 1], node[..., 0]]].transpose(2, 0, 1)
    on_fold = np.abs(x - FOLD) < 2
    heads = Heads(
        phase=(lattice - node).astype(np.float32),
        code=(0.9 * probable + 0.03).astype(np.float32),
        confidence=np.full(x.shape, 0.95, np.float32),
        edge=np.where(on_fold, edge, rng.uniform(0, 0.3, x.shape)).astype(np.float32),
    )
    lit = np.ones(x.shape, bool)
    return heads, Truth(lattice.transpose(2, 0, 1), lit, np.full(x.shape, -1, np.int8), on_fold)


def test_truth_of_links():
    """Oracle: by construction, links are false exactly where they cross the fold."""
    heads, truth = seen(0)
    graph, nodes = labelled_graph(heads, truth), find_nodes(smoothed(heads))
    beyond = nodes.at[:, 0] > FOLD - 0.5
    crosses = beyond[graph.links.start] != beyond[graph.links.end]
    assert 8 < crosses.sum() < 16
    np.testing.assert_array_equal(graph.link_real, ~crosses)


def test_training_finds_the_links_across_the_fold():
    """Oracle: the labels of a grid not trained on."""
    plan = GraphPlan(graphs=6, epochs=60, batch=2)
    net = train_graph_net([labelled_graph(*seen(k)) for k in range(6)], plan)
    unseen = labelled_graph(*seen(99))
    batch = joined([unseen])
    with torch.no_grad():
        link = net(batch.node, batch.link, batch.start, batch.end)[1].numpy() > 0
    np.testing.assert_array_equal(link, unseen.link_real)


def test_curves_of_an_easy_grid():
    """Every link right, by rules and by a network that was told so. Oracle: all is decoded."""
    heads, truth = seen(3, edge=0.9)
    plan = GraphPlan(graphs=4, epochs=25, batch=2)
    net = train_graph_net([labelled_graph(*seen(k)) for k in range(4)], plan)
    found = curves([Case("easy", heads, truth, CODE)], net)["easy"]
    for curve in found.values():
        assert curve.wrong.max() == 0
        assert curve.coverage[0] > 0.85


def test_picture_of_many_scenarios(tmp_path: Path):
    """Oracle: by hand; four panels a row, the last ones left white."""
    falling = np.linspace(0.9, 0.5, len(THRESHOLDS))
    curve = Curve(falling, 0.01 * falling)
    assert curve.at(0.7) == pytest.approx(0.007)
    save_comparison(tmp_path / "c.png", {f"s{k}": dict.fromkeys(METHODS, curve) for k in range(5)})
    picture = cv2.imread(str(tmp_path / "c.png"))
    height, width = picture.shape[:2]
    assert width / height == pytest.approx(2, abs=0.05)
    assert (picture[height // 2 + 20 :, width // 3 :] == 255).all()
    assert (picture[height // 2 + 20 :, : width // 4] < 255).any()
