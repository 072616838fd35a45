"""Scheduled runs: the workflow is well formed, and the commands it names exist."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
WORKFLOW = ROOT / ".github" / "workflows" / "weekly.yml"


def planned(target: str) -> subprocess.CompletedProcess[str]:
    """What make would run for a target, without running it."""
    if not shutil.which("make"):
        pytest.skip("make is absent")
    return subprocess.run(
        ["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, check=False
    )


def workflow() -> dict[Any, Any]:
    return yaml.safe_load(WORKFLOW.read_text("utf-8"))


def targets() -> list[str]:
    steps = [step for job in workflow()["jobs"].values() for step in job["steps"]]
    return [t for step in steps for t in re.findall(r"make (\S+)", step.get("run", ""))]


def test_it_runs_every_week_and_by_hand() -> None:
    """Oracle: the schema of workflows; YAML 1.1 reads the key ``on`` as true."""
    triggers = workflow()[True]
    assert set(triggers) == {"schedule", "workflow_dispatch"}
    (entry,) = triggers["schedule"]
    assert re.fullmatch(r"\d+ \d+ \* \* [0-6]", entry["cron"])
    assert all(job["runs-on"] for job in workflow()["jobs"].values())


def test_its_commands_exist() -> None:
    """Oracle: make's own plan, and the modules and folders named in it."""
    assert targets() == ["test-slow", "statistics", "test-learn"]
    for target in targets():
        plan = planned(target)
        assert plan.returncode == 0, plan.stderr
        for module in re.findall(r"-m (scripts\.\w+)", plan.stdout):
            assert (ROOT / f"{module.replace('.', '/')}.py").is_file()
        for path in re.findall(r"\btests/\S+", plan.stdout):
            assert (ROOT / path).exists()
    assert "scripts.statistics_study --seeds 100" in planned("statistics").stdout
    assert "slow or not slow" in planned("test-slow").stdout


def test_an_unknown_command_is_noticed() -> None:
    """Oracle: make refuses it."""
    assert planned("statistic").returncode != 0
