"""Numeric constants of modules: each says what it is, in which unit, and where it comes from."""

import ast
import re
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "mitsuba_endo"


def unexplained(source: str) -> list[str]:
    """Numeric constants with neither a docstring under them nor a comment beside or above them."""
    lines, body = source.splitlines(), ast.parse(source).body
    return [
        names[0]
        for node, after in pairwise([*body, None])
        if node
        and (names := _constant(node))
        and not (_docstring(after) or _commented(lines, node))
    ]


def _constant(node: ast.stmt) -> list[str]:
    """Names in capitals to which a statement gives numbers and no text."""
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return []
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    names = [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]
    values = [n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
    numeric = any(type(v) in (int, float) for v in values)
    if not numeric or any(isinstance(v, str) for v in values):
        return []
    return [name for name in names if name.isupper()]


def _docstring(node: ast.stmt | None) -> str:
    value = node.value if isinstance(node, ast.Expr) else None
    text = value.value if isinstance(value, ast.Constant) else ""
    return text if isinstance(text, str) else ""


def _commented(lines: list[str], node: ast.stmt) -> bool:
    above, beside = lines[node.lineno - 2], lines[(node.end_lineno or node.lineno) - 1]
    return (above.startswith("#") and node.lineno > 1) or bool(re.search(r"#(?! fmt)", beside))


def test_every_constant_is_explained() -> None:
    """Oracle: the modules' own statements."""
    found = {
        (path.relative_to(PACKAGE).as_posix(), name)
        for path in PACKAGE.rglob("*.py")
        for name in unexplained(path.read_text("utf-8"))
    }
    assert not found


def test_a_bare_constant_is_found() -> None:
    """Oracle: by hand; texts, switches and variables need no unit, a mark for the formatter is no
    explanation."""
    bare = (
        "A = 3\n_B: float = 2 * 0.5\nC, D = 1, 2\nE = (1,)  # fmt: skip\n\n\ndef f():\n    G = 1\n"
    )
    assert unexplained(bare) == ["A", "_B", "C", "E"]
    assert unexplained('A = 3\n"""Pixels."""\nB = 4  # mm\n# Degrees.\nC = 5\n') == []
    assert unexplained('A = "3"\nB = True\nc = 4\nD = {"E": 5}\n') == []


def test_factors_of_statistics_and_angles_have_one_home() -> None:
    """Oracle: the text of all modules and scripts; degrees are NumPy's affair."""
    paths = [
        p for folder in (PACKAGE, ROOT / "plugins", ROOT / "scripts") for p in folder.rglob("*.py")
    ]
    factor = re.compile(r"1\.482\d|0\.674\d|180(\.0)? ?/ ?(np|math)\.pi|(np|math)\.pi ?/ ?180")
    hits = [p.name for p in paths for _ in factor.finditer(p.read_text("utf-8"))]
    assert set(hits) == {"robust.py"}
    assert hits.count("robust.py") == 1
