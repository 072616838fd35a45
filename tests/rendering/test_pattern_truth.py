"""The grid's truth of a capture against its own image."""

from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.exr_files import read_exr
from mitsuba_endo.rendering.pattern_truth import coded_grid, grid_truth
from mitsuba_endo.rendering.render import render_capture
from mitsuba_endo.rendering.scene import load_scene
from mitsuba_endo.show.capture_folder import write_capture_folder

SMALL = {"width": 80, "height": 58, "fx": 66, "cx": 38.2, "cy": 30.1, "light": 0}
GRID = "pattern:coded?width=480&height=384&columns=10&rows=9&period=36&line=0.1&seed=4"


def test_truth_says_where_lines_are_bright(llvm: str, tmp_path: Path) -> None:
    """Oracle: the rendered image is bright where the phase across a vertical line is zero.

    The file is no map: a solver that is given it refuses.
    """
    loaded = load_scene("sheet", **SMALL, pattern=GRID)
    capture = render_capture(loaded, spp=16)
    write_capture_folder(tmp_path / "out", capture, loaded)
    truth = read_exr(tmp_path / "out" / "truth_grid.exr")
    assert set(truth) == {"phase.x", "phase.y", "node.column", "node.row", "code"}
    lit = capture.visible & np.isfinite(truth["phase.x"])
    across = np.abs(truth["phase.x"])
    away = lit & (across > 2.5) & (np.abs(truth["phase.y"]) > 2.5)
    on = lit & (across < 0.2)
    assert min(on.sum(), away.sum()) > 30
    green = capture.image[..., 1]
    assert np.median(green[on]) > 5 * np.median(green[away])
    node = np.stack([truth["node.column"], truth["node.row"]], -1)[lit].astype(int)
    assert (node >= 0).all()
    assert (node < [10, 9]).all()
    grid = coded_grid(loaded)
    assert grid is not None
    np.testing.assert_array_equal(truth["code"][lit], grid.code[node[:, 1], node[:, 0]])
    with pytest.raises(InputError, match="several pairs may be projector x and y"):
        load_map(tmp_path / "out" / "truth_grid.exr")


def test_a_stretched_grid_keeps_its_nodes(llvm: str) -> None:
    """Oracle: nodes of the grid, stretched by hand onto a pattern of half the size."""
    loaded = load_scene("sheet", **SMALL, pattern=GRID)
    grid = coded_grid(loaded)
    assert grid is not None
    q = (grid.nodes + 0.5) / 2 - 0.5
    truth = grid_truth(grid, q, (240, 192))
    columns, rows = np.meshgrid(np.arange(10), np.arange(9))
    np.testing.assert_array_equal(truth.node, np.stack([columns, rows], -1))
    np.testing.assert_allclose(truth.phase, 0, atol=1e-9)


def test_other_patterns_have_no_grid(llvm: str) -> None:
    """Oracle: None for the plain grid."""
    plain = load_scene("sheet", **SMALL, pattern="pattern:grid")
    assert coded_grid(plain) is None
