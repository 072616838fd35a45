"""One name, one thing: no public class of the decoder is also that of another room."""

import ast
from collections import defaultdict
from pathlib import Path

import mitsuba_endo

PACKAGE = Path(mitsuba_endo.__file__).parent


def test_class_names_have_one_meaning():
    """Oracle: all classes of the package, by the files that define them."""
    homes = defaultdict(set)
    for path in PACKAGE.rglob("*.py"):
        for part in ast.parse(path.read_text("utf-8")).body:
            if isinstance(part, ast.ClassDef) and not part.name.startswith("_"):
                homes[part.name].add(path.relative_to(PACKAGE))
    shared = {
        name: sorted(map(str, paths))
        for name, paths in homes.items()
        if len(paths) > 1 and any(path.parts[0] == "decoding" for path in paths)
    }
    assert not shared
