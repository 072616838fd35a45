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
