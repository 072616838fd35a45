"""The glossary against the records, the blocks and the folder tree."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from mitsuba_endo.records.rig import Rig
from mitsuba_endo.records.solution import Solution
from mitsuba_endo.solve.unknowns.block import BLOCKS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "glossary.md").read_text("utf-8")
PAPER = (
    "surface", "camera pose", "projector pose", "rotation", "translation", "focal length",
    "projector coordinate", "correspondence map", "rendered coordinates", "robust loss",
    "front-parallel plane", "single-frame calibration", "multi-frame calibration",
    "configuration B", "baseline", "grating equation", "coded grid", "gap code", "phase",
    "grid graph", "registration", "fusion", "polyp size",
)  # fmt: skip
"""What the paper speaks of."""


def records(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """The record and all inside it."""
    yield model
    for field in model.model_fields.values():
        for inner in _inside(field.annotation):
            yield from records(inner)


def _inside(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in getattr(annotation, "__args__", ()):
        yield from _inside(part)


RECORDS = sorted({*records(Rig), *records(Solution)}, key=lambda r: r.__name__)


def section(heading: str) -> str:
    """The text under the one heading that ends so."""
    (text,) = re.findall(rf"^#+ [^\n]*{re.escape(heading)}\n(.*?)(?=^#|\Z)", PAGE, re.M | re.S)
    return text


def rows(heading: str) -> dict[str, list[str]]:
    """Rows of the table under a heading, by their first cell."""
    lines = [line for line in section(heading).splitlines() if line.startswith("|")][2:]
    cells = [[c.strip() for c in line.strip("|").split(" | ")] for line in lines]
    assert len(cells) == len({c[0] for c in cells})
    return {c[0]: c[1:] for c in cells}


def test_all_records_are_looked_at() -> None:
    """Oracle: the files' parts as rig.yaml and solution.json nest them."""
    names = {record.__name__ for record in RECORDS}
    assert {"Camera", "KnownDistance", "GivenPose", "PoseEstimate", "Alternative"} <= names
    assert len(names) == 16


@pytest.mark.parametrize("record", RECORDS, ids=lambda r: r.__name__)
def test_every_key_is_there_and_no_other(record: type[BaseModel]) -> None:
    """Oracle: the schema that reads the files, and the blocks that a sharing plan may name."""
    keys = {field.alias or name for name, field in record.model_fields.items()}
    if record.__name__ == "Share":
        keys |= set(BLOCKS)
    assert set(rows(f"`{record.__name__}`")) == {f"`{key}`" for key in keys}


def test_every_file_exists() -> None:
    """Oracle: the folder tree."""
    files = re.findall(r"`([\w/]+\.py)`", PAGE)
    assert len(set(files)) > 50
    assert [f for f in files if not (ROOT / "mitsuba_endo" / f).is_file()] == []
    plugins = re.findall(r"plugin `(\w+)`", PAGE)
    assert plugins
    assert all((ROOT / "plugins" / f"{name}.py").is_file() for name in plugins)


def test_every_term_has_a_file() -> None:
    """Oracle: a file in the last column, the paper's words and symbols among the rows."""
    terms = rows("Terms")
    assert all(".py`" in cells[-1] for cells in terms.values())
    assert set(PAPER) <= set(terms)
    symbols = {cells[0] for cells in terms.values()}
    assert {"$S$", "$C$", "$P$", "$R$", "$t$", "$f$", "$q$", "$R(S, C, P)$"} <= symbols
