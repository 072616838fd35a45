"""``report`` from the command line: bad input; what it writes is tested in tests/show."""

from pathlib import Path

import pytest

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


def test_folder_without_a_solution_is_named(tmp_path: Path):
    """Oracle: the file that a report is made of, whatever else lies there."""
    for other in (None, "truth.json"):
        if other is not None:
            (tmp_path / other).write_text("{}", encoding="utf-8")
        result = run("report", tmp_path, "--out", tmp_path / "report.html")
        assert result.exit_code == 2
        assert result.stderr.startswith(f"error: {tmp_path / 'solution.json'}: no such file; ")


@pytest.mark.parametrize("name", ["r.txt", "report", "report.html.gz"])
def test_report_is_html(tmp_path: Path, name: str):
    """Oracle: the sentence; it comes before the result is read, which here is not there."""
    result = run("report", tmp_path, "--out", tmp_path / name)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {tmp_path / name}: a report is HTML; ")
    assert list(tmp_path.iterdir()) == []


def test_names_tell_results_apart(tmp_path: Path):
    """Oracle: the shortest ends of the paths that differ."""
    paths = [tmp_path / "a" / "out", tmp_path / "b" / "out" / "solution.json"]
    assert _names(paths) == ["a/out", "b/out"]
    assert _names([paths[0]]) == ["out"]
