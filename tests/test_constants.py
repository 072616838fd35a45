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


def thresholds(source: str) -> list[float]:
    """Numbers with a point that a function compares something with, but for 0, 1/2 and 1.

    Left out are shares of chance, ``rng.random() < 0.3``, which stand beside what they choose.
    """
    functions = [f for f in ast.walk(ast.parse(source)) if isinstance(f, ast.FunctionDef)]
    compared = {n for f in functions for n in ast.walk(f) if isinstance(n, ast.Compare)}
    return [
        number
        for node in compared
        if not re.search(r"\.random\(\)$", ast.unparse(node.left))
        for side in (node.left, *node.comparators)
        for number in _numbers(side)
        if number not in (0.0, 0.5, 1.0)
    ]


def _numbers(node: ast.AST) -> list[float]:
    """Numbers with a point in an expression; what a call takes by name is none of the measure."""
    if isinstance(node, ast.Constant):
        return [node.value] if type(node.value) is float else []
    if isinstance(node, ast.keyword):
        return []
    return [n for child in ast.iter_child_nodes(node) for n in _numbers(child)]


def test_no_threshold_is_hidden_in_a_function() -> None:
    """Oracle: the functions' own comparisons; a threshold is a constant, which says what it is."""
    hidden = {
        path.relative_to(PACKAGE).as_posix(): found
        for path in PACKAGE.rglob("*.py")
        if (found := thresholds(path.read_text("utf-8")))
    }
    assert not hidden


def test_a_hidden_threshold_is_found() -> None:
    """Oracle: by hand."""
    assert thresholds("def f(x):\n    return g(x, 0.3, h=0.7) < 2.5 * x\n") in (
        [0.3, 2.5],
        [2.5, 0.3],
    )
    assert (
        thresholds("def f(x):\n    return x > 0.5 or x < 1.0 or x == 3 or rng.random() < 0.3\n")
        == []
    )
    assert thresholds("LIMIT = 0.3\n\n\ndef f(x):\n    return x > LIMIT\n") == []


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
