"""Every experiment runs from its command line and says the same again."""

import csv
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[2] / "scripts"
NEEDS = {
    "simulation": (), "focal": (), "polyp": (), "phantoms": (), "peers": ("pycolmap",),
    "robustness": ("pycolmap",), "per_frame": ("small_gicp", "open3d"),
}  # fmt: skip
QUICK = ("simulation",)
"""Scripts that are run in the fast tests; the others take up to a minute each."""


def run(name: str, out: Path) -> dict[str, str]:
    """Run a script; return its tables by name."""
    command = [sys.executable, str(SCRIPTS / f"reproduce_{name}.py"), "--quick", "--out", str(out)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return {p.stem: p.read_text() for p in sorted(out.glob("*.csv"))}


@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in NEEDS]
)
def test_the_script_writes_tables_and_pictures(name: str, tmp_path: Path) -> None:
    """Oracle: its own table is there with a number in every row, and a picture with it."""
    if any(importlib.util.find_spec(package) is None for package in NEEDS[name]):
        pytest.skip(f"needs {', '.join(NEEDS[name])}")
    tables = run(name, tmp_path)
    rows = list(csv.DictReader(tables[name].splitlines()))
    assert rows
    assert all(any(c.isdigit() for value in row.values() for c in value) for row in rows)
    assert list(tmp_path.glob("*.png"))


@pytest.mark.slow
def test_the_same_seed_gives_the_same_table(tmp_path: Path) -> None:
    """Oracle: the first run."""
    assert run("focal", tmp_path / "a") == run("focal", tmp_path / "b")
