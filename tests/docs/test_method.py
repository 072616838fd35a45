"""The method's table of formulas against the folder tree."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "method.md").read_text("utf-8")
TABLE = PAGE[PAGE.index("## Where each formula is") :]


def files_of(table: str) -> dict[str, list[str]]:
    """Files of each row of a table, by its formula."""
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    rows = [line.strip("|").rsplit(" | ", 1) for line in lines]
    return {formula.strip(): re.findall(r"`([^`]+)`", files) for formula, files in rows}


def missing(table: str) -> list[str]:
    """Files that a table names and the package lacks, and formulas without any."""
    found = files_of(table)
    absent = [f for files in found.values() for f in files if not is_module(f)]
    return absent + [formula for formula, files in found.items() if not files]


def is_module(name: str) -> bool:
    return name.endswith(".py") and (ROOT / "mitsuba_endo" / name).is_file()


def test_every_formula_has_a_file_that_exists() -> None:
    """Oracle: the folder tree."""
    assert len(files_of(TABLE)) >= 20
    assert missing(TABLE) == []


def test_what_is_missing_is_noticed() -> None:
    """Oracle: by hand; one file is there, one is not, one formula has none."""
    table = (
        "| F | At |\n|--|--|\n| $a$ | `geometry/transforms.py`, `geometry/b.py` |\n| $c$ | in C |"
    )
    assert missing(table) == ["geometry/b.py", "$c$"]


def test_symbols_of_the_pages_equations_are_in_the_table() -> None:
    """Oracle: what the page's displayed equations define."""
    for symbol in (
        r"\varrho",
        r"\rho",
        r"\sigma",
        "X^0",
        "A^{-1}",
        "I^{-1}",
        r"\alpha",
        r"\lambda",
    ):
        assert symbol in PAGE.split("## Where")[0]
        assert symbol in TABLE
