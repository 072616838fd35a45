"""Names of Python objects in the documentation's pages."""

import importlib
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
_NAME = re.compile(r"\]\[(mitsuba_endo[\w.]+)\]|^::: (mitsuba_endo[\w.]+)$", re.M)


def names_on(page: Path) -> list[str]:
    return [a or b for a, b in _NAME.findall(page.read_text("utf-8"))]


def exists(name: str) -> bool:
    """Whether a dotted name is a module or something in one."""
    parts = name.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        for part in parts[end:]:
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda p: p.stem)
def test_every_name_on_a_page_exists(page: Path) -> None:
    """Oracle: imports."""
    assert [name for name in names_on(page) if not exists(name)] == []


@pytest.mark.usefixtures("llvm")
def test_what_method_and_reference_name_is_looked_at() -> None:
    """Oracle: a name that is there and one that is not; both pages have many."""
    assert exists("mitsuba_endo.geometry.projection_models.ProjectionModel")
    assert not exists("mitsuba_endo.geometry.projection_models.Lore")
    assert all(len(names_on(DOCS / page)) > 15 for page in ("method.md", "reference.md"))


def test_every_name_that_method_links_to_is_in_the_reference() -> None:
    """Oracle: a link leads where the reference documents the object, or what it is part of."""
    documented = names_on(DOCS / "reference.md")
    linked = names_on(DOCS / "method.md")
    assert [n for n in linked if not any(n == d or n.startswith(f"{d}.") for d in documented)] == []
