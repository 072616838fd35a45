"""The coded grid as files. Oracle: the grid's own brightness and code, read back."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from mitsuba_endo.decoding.grid_files import JSON, PNG, SVG, TIFF, save_grid, segments
from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.decoding.pattern_option import coded_grid
from tests.cli.inputs import run

GRID = CodedGrid(width=300, height=220, columns=20, rows=14, seed=3, step=0.3)
SIZE = ("--width", 300, "--height", 220)


def test_lines_lie_where_the_pattern_is_bright():
    """Oracle: the brightness that the decoder's truth has; a line's middle is 1."""
    ends = segments(GRID)
    for share in (0.02, 0.3, 0.5, 0.98):
        at = (1 - share) * ends[:, 0] + share * ends[:, 1]
        np.testing.assert_allclose(GRID.brightness(at), 1.0, atol=1e-9)
    assert len(ends) == 20 + 14 * 21


def test_the_drawing_covers_what_is_bright(tmp_path: Path):
    """Oracle: the picture; strokes drawn by OpenCV cover what is brighter than one half."""
    save_grid(tmp_path / "grid", GRID)
    text = (tmp_path / "grid" / SVG).read_text("utf-8")
    width = float(re.findall(r'stroke-width="([\d.]+)"', text)[0])
    canvas = np.zeros((220 * 8, 300 * 8), np.uint8)
    for piece in re.findall(r"M([-\d.,L]+)", text):
        a, b = (tuple(round(8 * float(v)) for v in p.split(",")) for p in piece.split("L"))
        cv2.line(canvas, a, b, 255, max(1, round(8 * width)))
    drawn = canvas > 0
    light = GRID.texture(300 * 8, 220 * 8)
    light = (light - GRID.background) / (1 - GRID.background)
    assert drawn[light > 0.6].mean() > 0.99
    assert drawn[light < 0.3].mean() < 0.03


def test_files_read_back(tmp_path: Path):
    """Oracle: the texture, to half a step of each depth; the settings make the same grid."""
    save_grid(tmp_path / "grid", GRID)
    light = GRID.texture(600, 440)
    for name, full in ((PNG, 255), (TIFF, 65535)):
        image = cv2.imread(str(tmp_path / "grid" / name), cv2.IMREAD_UNCHANGED)
        assert image is not None
        np.testing.assert_allclose(image / full, light / light.max(), atol=0.51 / full)
    told = json.loads((tmp_path / "grid" / JSON).read_text("utf-8"))
    again = coded_grid(told["pattern"], told["width"], told["height"])
    assert again == GRID
    np.testing.assert_array_equal(told["code"], GRID.code)
    np.testing.assert_allclose(told["nodes"], GRID.nodes, atol=1e-6)


@pytest.mark.parametrize("kind", ["coded", "coded?seed=3", "pattern:coded?seed=3"])
def test_the_command(tmp_path: Path, kind: str):
    """Oracle: the files, and the description in the command that it prints."""
    made = run("patterns", "--pattern", kind, *SIZE, "--out", tmp_path / "out", "--json")
    assert made.exit_code == 0, made.stderr
    told = json.loads(made.stdout)
    assert told["images"] == [PNG, TIFF, SVG, JSON]
    (named,) = re.findall(r"--pattern '([^']+)'", told["decode"])
    assert coded_grid(named, 300, 220).seed == (3 if "seed" in kind else 0)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (("--inverse",), "--inverse: is for stacks"),
        (("--no-reference",), "--no-reference: is for stacks"),
        (("--stripe", 4), "--stripe: is for stacks"),
        (("--periods", "40,8"), "--periods: is for stacks"),
        (("--steps", 4), "--steps: is for stacks"),
    ],
)
def test_options_of_stacks_are_refused(tmp_path: Path, options: tuple, what: str):
    made = run("patterns", "--pattern", "coded", *SIZE, *options, "--out", tmp_path / "out")
    assert made.exit_code == 2
    assert what in made.stderr
    assert not (tmp_path / "out").exists()


def test_unknown_settings_are_refused(tmp_path: Path):
    made = run("patterns", "--pattern", "coded?lines=3", *SIZE, "--out", tmp_path / "out")
    assert made.exit_code == 2
    assert "--pattern: lines" in made.stderr
