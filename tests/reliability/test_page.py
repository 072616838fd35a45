"""What docs/reliability.md names is there.

Oracle: the files, tests and variables themselves.
"""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from mitsuba_endo.reading import regular, trees

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reliability.md").read_text(encoding="utf-8")
KINDS = {v.name: v for v in vars(regular).values() if isinstance(v, regular.SizeLimit)}


def test_every_test_and_script_that_is_named_exists():
    named = set(re.findall(r"`((?:tests|scripts)/[\w/]+\.py)`", PAGE))
    assert len(named) > 8
    assert not [name for name in named if not (ROOT / name).is_file()]


def test_every_command_that_is_named_is_a_module():
    named = re.findall(r"python -m (scripts\.\w+)", PAGE)
    assert len(named) == 3
    assert all((ROOT / f"{name.replace('.', '/')}.py").is_file() for name in named)


@pytest.mark.parametrize("script", ["campaign", "kills"])
def test_a_campaign_of_nothing_says_so(tmp_path: Path, script: str):
    """Oracle: one sentence, the code of bad usage, and no folder."""
    command = [sys.executable, "-m", f"scripts.reliability_{script}", "--only", "unknown"]
    out = tmp_path / "out"
    done = subprocess.run([*command, "--out", str(out)], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert "nothing begins with 'unknown'" in " ".join(done.stderr.replace("│", " ").split())
    assert "Traceback" not in done.stderr
    assert not out.exists()


def test_every_limit_is_named_and_no_other():
    stated = re.search(r"Further kinds are (.*?)\.\n", PAGE, re.DOTALL)
    assert stated is not None
    names = {*re.findall(r"`([A-Z]+)`", stated[1]), "MAP"}
    assert names == {name.upper() for name in KINDS}


def test_the_numbers_are_those_of_the_code():
    assert f"depth ({trees.DEEPEST})" in PAGE
    assert trees.MOST == 1_000_000
    assert "values (a million)" in PAGE


@pytest.mark.parametrize("mib", ["2048"])
def test_the_example_of_a_limit_works(monkeypatch: pytest.MonkeyPatch, mib: str):
    assert f"`{regular.MAP.variable}={mib}`" in PAGE
    monkeypatch.setenv(regular.MAP.variable, mib)
    assert regular.MAP.limit() == 2048 << 20
