"""``report`` from the command line: bad input; what it writes is tested in tests/show."""

from pathlib import Path

from mitsuba_endo.cli.report import _names
from tests.cli.inputs import run


def test_bad_input_is_one_sentence(tmp_path: Path):
    """Oracle: exit code 2, one line that names the folder, and no report."""
    out = tmp_path / "report.html"
    result = run("report", tmp_path / "absent", "--out", out)
    assert result.exit_code == 2
    assert "absent" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not out.exists()


def test_names_tell_results_apart(tmp_path: Path):
    """Oracle: the shortest ends of the paths that differ."""
    paths = [tmp_path / "a" / "out", tmp_path / "b" / "out" / "solution.json"]
    assert _names(paths) == ["a/out", "b/out"]
    assert _names([paths[0]]) == ["out"]
