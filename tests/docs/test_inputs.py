"""Inputs as other people bring them: read right, or refused by name, as docs/inputs.md says."""

import re
from pathlib import Path

import pytest

from scripts.inputs.case import RIGHT, TOLD, WRONG, Case, Ending, outcome_of
from scripts.make_inputs_page import CASES, PAGE, page, row

_NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


def _without_numbers(text: str) -> str:
    """Leave out digits, whose last ones are the machine's."""
    return _NUMBER.sub("#", text)


def test_there_are_enough() -> None:
    """Oracle: the number asked for; each is another input, or has other options."""
    assert len(CASES) >= 60
    assert len({(case.kind, case.brings, case.expected) for case in CASES}) == len(CASES)
    for case in CASES:
        assert bool(case.words) == (case.expected != RIGHT), case.brings


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.kind}: {case.brings}")
def test_what_becomes_of_it(case: Case, tmp_path: Path) -> None:
    """Oracle: what it was made from; what is refused or warned of is so for its real cause."""
    ended = outcome_of(case, tmp_path)
    assert ended.agrees(case), ended
    assert _without_numbers(row(case, ended)) in _without_numbers(PAGE.read_text("utf-8"))


def test_the_page_has_every_input_and_no_other() -> None:
    """Oracle: the rows of the list."""
    rows = [line for line in PAGE.read_text("utf-8").splitlines() if line.startswith("| ")]
    assert len([line for line in rows if not line.startswith("| Brought")]) == len(CASES)
    assert f"becomes of {len(CASES)} inputs" in PAGE.read_text("utf-8")
    assert WRONG not in PAGE.read_text("utf-8")
    assert "inputs.md" in (PAGE.parents[1] / "mkdocs.yml").read_text("utf-8")


def test_a_wrong_answer_would_be_seen(tmp_path: Path) -> None:
    """Oracle: an answer that is off, with and without a word, and one off that may be."""
    off = Case("map", "a", RIGHT, "", lambda folder: Ending(1.5))
    assert outcome_of(off, tmp_path).outcome == WRONG
    assert not outcome_of(off, tmp_path).agrees(off)
    told = Case("map", "a", TOLD, "off", lambda folder: Ending(1.0, ["it is off"]))
    assert outcome_of(told, tmp_path).agrees(told)
    silent = Case("map", "a", TOLD, "off", lambda folder: Ending(1.0))
    assert not outcome_of(silent, tmp_path).agrees(silent)
    assert WRONG in page([outcome_of(off, tmp_path)] * len(CASES))
