"""The page of wrong models says what the program says. Oracle: running it again."""

import re
from pathlib import Path

import pytest

from scripts.make_wrong_models_page import PAGE, SHOWN, sections

_NUMBER = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")


def _without_numbers(text: str) -> str:
    """Leave out digits, whose last ones are the machine's."""
    return _NUMBER.sub("#", text)


def test_the_page_shows_six_wrong_models() -> None:
    assert len(SHOWN) == 6
    assert Path(PAGE).name in (Path(PAGE).parents[1] / "mkdocs.yml").read_text("utf-8")


@pytest.mark.usefixtures("llvm")
def test_the_page_says_what_the_program_says() -> None:
    """But for numbers, which differ from machine to machine in their last digits."""
    said = "\n".join(sections()).rstrip() + "\n"
    assert _without_numbers(PAGE.read_text("utf-8")) == _without_numbers(said)
