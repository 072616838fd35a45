"""Names of the package: one meaning each, found again in the glossary."""

import ast
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "mitsuba_endo"


def public_classes(package: Path) -> dict[str, list[str]]:
    """Modules, relative to the package, that define each public class at their top."""
    found = defaultdict(list)
    for path in sorted(package.rglob("*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found[node.name].append(path.relative_to(package).as_posix())
    return found


def test_no_public_class_has_two_meanings() -> None:
    """Oracle: every name is defined once."""
    classes = public_classes(PACKAGE)
    assert len(classes) > 150
    twice = {name: modules for name, modules in classes.items() if len(modules) > 1}
    assert not twice


def test_a_second_meaning_is_found(tmp_path: Path) -> None:
    """Oracle: two modules of other folders that define one name; a private one does not count."""
    for folder, text in (("a", "class Pose: ...\nclass _Own: ..."), ("b", "class Pose: ...")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "module.py").write_text(text, "utf-8")
    assert public_classes(tmp_path) == {"Pose": ["a/module.py", "b/module.py"]}


def twins(modules: list[str]) -> list[tuple[str, str]]:
    """Files of one room that have one name, or names that a plural's s tells apart.

    Args:
        modules: relative to the package. Registries are called so in every folder that has one.
    """
    named = [(m.partition("/")[0], Path(m).stem, m) for m in modules]
    return [
        (first, second)
        for room, name, first in named
        for other, like, second in named
        if first != second and room == other and name != "registry" and like in (name, f"{name}s")
    ]


def modules_of(package: Path) -> list[str]:
    found = [p.relative_to(package).as_posix() for p in sorted(package.rglob("*.py"))]
    return [name for name in found if not Path(name).stem.startswith("__")]


def test_no_two_files_of_a_room_are_called_alike() -> None:
    """Oracle: the folder tree."""
    modules = modules_of(PACKAGE)
    assert len(modules) > 300
    assert twins(modules) == []


def test_no_file_is_called_as_a_room() -> None:
    """Oracle: the folder tree; a command is called as what it runs."""
    rooms = {p.parent.name for p in PACKAGE.glob("*/__init__.py")}
    files = [m for m in modules_of(PACKAGE) if not m.startswith("cli/")]
    assert [m for m in files if Path(m).stem in rooms] == []


def test_twins_are_found() -> None:
    """Oracle: by hand."""
    assert twins(["a/strip.py", "a/b/strips.py", "c/strips.py"]) == [
        ("a/strip.py", "a/b/strips.py")
    ]
    assert len(twins(["a/plan.py", "a/b/plan.py", "a/registry.py", "a/b/registry.py"])) == 2
