"""What docs/architecture.md says of the structure, held against the code's own imports."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "mitsuba_endo"
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
LOOKS_UP = {("records", "show")}
"""The one look up the house that the page names: a notebook asks a record to show itself."""


def rooms() -> list[str]:
    """The rooms of the page's table, top to bottom; the first row holds single files."""
    table = PAGE[PAGE.index("| Room |") : PAGE.index("## Walls")]
    return [m for row in table.splitlines()[3:] for m in re.findall(r"^\| `(\w+)`", row)]


def solver_packages() -> list[str]:
    part = PAGE[PAGE.index("| Package |") : PAGE.index("## Decisions in the solver")]
    return re.findall(r"^\| `(\w+)` \|", part, re.M)


def imports(path: Path) -> set[tuple[str, ...]]:
    """Absolute names below the package of everything that a file imports, at any depth."""
    inside = path.relative_to(PACKAGE).parent.parts
    out = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.ImportFrom):
            continue
        module = tuple((node.module or "").split(".")) if node.module else ()
        if node.level:
            out.add(inside[: len(inside) - node.level + 1] + module)
        elif module[:1] == (PACKAGE.name,):
            out.add(module[1:])
    return {name for name in out if name}


def violations(order: list[str], folder: Path, depth: int) -> list[str]:
    """Imports of a later package by an earlier one."""
    place = {name: i for i, name in enumerate(order)}
    found = []
    for path in sorted(folder.rglob("*.py")):
        own = path.relative_to(PACKAGE).parts[depth]
        for name in imports(path):
            other = name[depth] if len(name) > depth else ""
            later = place.get(other, -1) > place.get(own, len(order))
            here = name[:depth] == path.relative_to(PACKAGE).parts[:depth]
            if later and here and (own, other) not in LOOKS_UP:
                found.append(f"{path.relative_to(ROOT)} imports {'.'.join(name)}")
    return found


def test_every_room_is_in_the_table() -> None:
    """Oracle: the folders of the package."""
    folders = {p.parent.name for p in PACKAGE.glob("*/__init__.py")}
    assert folders == set(rooms())


def test_rooms_import_from_rooms_above() -> None:
    """Oracle: the order of the table."""
    assert violations(rooms(), PACKAGE, 0) == []


def test_packages_of_the_solver_import_those_before() -> None:
    """Oracle: the order of the solver's table, which lists every folder."""
    folders = {p.parent.name for p in (PACKAGE / "solve").glob("*/__init__.py")}
    assert folders == set(solver_packages())
    assert violations(solver_packages(), PACKAGE / "solve", 1) == []


@pytest.mark.parametrize("path", re.findall(r"`((?:\w+/)+\w+\.py)`", PAGE))
def test_files_named_on_the_page_exist(path: str) -> None:
    assert (PACKAGE / path).is_file() or (ROOT / path).is_file()
