"""The matcher's thresholds: one record, each documented, each of them used."""

import ast
from dataclasses import fields, replace
from pathlib import Path

import pytest

import mitsuba_endo.decoding.grid
from mitsuba_endo.decoding.grid.decode import DEFAULTS, decode_heads
from mitsuba_endo.decoding.grid.settings import MatcherSettings
from mitsuba_endo.decoding.grid_pattern import CodedGrid
from mitsuba_endo.decoding.network import CHANNELS, read_heads
from tests.decoding.grid_views import view
from tests.decoding.heads import Errors, network_output

ROOM = Path(mitsuba_endo.decoding.grid.__file__).parent
NAMES = [field.name for field in fields(MatcherSettings)]
SOURCES = ("By hand", "Geometry", "Chance", "Study")


def test_every_threshold_says_its_source():
    """Oracle: the text under each field, as a reader sees it."""
    body = ast.parse((ROOM / "settings.py").read_text("utf-8")).body
    record = next(part for part in body if isinstance(part, ast.ClassDef))
    texts = {}
    for before, text in zip(record.body, record.body[1:], strict=False):
        if isinstance(before, ast.AnnAssign) and isinstance(text, ast.Expr):
            texts[ast.unparse(before.target)] = ast.literal_eval(text.value)
    assert sorted(texts) == sorted(NAMES)
    for name, text in texts.items():
        assert any(source in text for source in SOURCES), name


def test_no_threshold_is_ignored_or_lives_elsewhere():
    """Oracle: the room's own code: each field is read, and no module has a number of its own."""
    rest = [path for path in ROOM.glob("*.py") if path.name != "settings.py"]
    code = "\n".join(path.read_text("utf-8") for path in rest)
    own = (ROOM / "settings.py").read_text("utf-8")
    for name in NAMES:
        assert f".{name}" in code or f"self.{name}" in own, name
    for path in rest:
        for part in ast.parse(path.read_text("utf-8")).body:
            if isinstance(part, ast.Assign):
                assert not isinstance(part.value, ast.Constant), ast.unparse(part)


@pytest.mark.parametrize(
    ("change", "least", "most"),
    [
        ({}, 0.75, 0.85),
        ({"pixel_confidence": 0.999}, 0, 0),
        ({"node_confidence": 0.999}, 0, 0),
        ({"link_confidence": 0.999}, 0, 0),
        # Of six and more columns on each side only the middle ones are reached from four nodes.
        ({"component_share": 1.1, "total_share": 1.1, "large_part": 10_000}, 0, 0),
        ({"conflict_margin": 0, "single_links": 0, "spread_rounds": 0}, 0.7, 0.84),
    ],
)
def test_settings_reach_the_decoder(llvm, change: dict, least: float, most: float):
    """Oracle: by hand: the confidence of the outputs is 0.953 wherever there is any."""
    heads = read_heads(network_output(view("sheet"), CodedGrid(), Errors()), CHANNELS)
    decoded = decode_heads(heads, CodedGrid(), replace(DEFAULTS, **change))
    assert least <= decoded.coverage <= most
