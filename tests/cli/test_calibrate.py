"""Parts of ``calibrate`` that need no solver."""

from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from mitsuba_endo.cli.calibrate import exit_code, load_input, with_sharing
from mitsuba_endo.cli.summary import comparison_table, solution_table
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.records.solution import Estimate, Outcome, Solution
from tests.cli.inputs import q, rig, write


def _solution(outcome: Outcome, scale: str) -> Solution:
    return Solution.model_validate(
        {
            "outcome": outcome,
            "units": "mm",
            "scale": scale,
            "projector": {
                "law": "pinhole",
                "focal": {"value": 1, "status": "measured"},
                "centre": {"value": [1, 2], "status": "fixed"},
            },
            "frames": [
                {
                    "name": "a",
                    "projector_from_camera": {"R": np.eye(3).tolist(), "t": [1, 0, 0]},
                    "world_from_camera": {"R": np.eye(3).tolist(), "t": [0, 0, 0]},
                }
            ],
        }
    )


@pytest.mark.parametrize(
    ("outcome", "code"),
    [
        (Outcome.CONVERGED, 0),
        (Outcome.MAX_ITERATIONS, 1),
        (Outcome.STALLED, 1),
        (Outcome.INTERRUPTED, 130),
    ],
)
def test_exit_code(outcome: Outcome, code: int):
    """Oracle: the table of exit codes in the help."""
    solution = _solution(outcome, "baseline")
    assert exit_code(solution) == code


@pytest.mark.parametrize(
    ("scale", "status"), [("baseline", "fixed"), ("known_distance", "measured")]
)
def test_given_baseline_is_not_called_measured(scale: str, status: str):
    """Oracle: the solution's scale says what was given."""
    console = Console(file=StringIO(), width=100)
    console.print(solution_table(_solution(Outcome.CONVERGED, scale)))
    assert isinstance(console.file, StringIO)
    row = next(line for line in console.file.getvalue().splitlines() if "baseline" in line)
    assert status in row


@pytest.mark.parametrize("compared", [False, True])
def test_tables_show_95_percent_intervals(compared: bool):
    """Oracle: docs/conventions.md: ± is 1.96 standard deviations; those are 2 here, and 0.5 for the
    translation."""
    solution = _solution(Outcome.CONVERGED, "baseline")
    focal = Estimate(value=300.0, std=2.0, status="measured")
    projector = solution.projector.model_copy(update={"focal": focal})
    pose = solution.frames[0].projector_from_camera.model_copy(
        update={"std": [np.radians(2.0)] * 3 + [0.5] * 3}
    )
    frames = [solution.frames[0].model_copy(update={"projector_from_camera": pose})]
    solution = solution.model_copy(update={"projector": projector, "frames": frames})
    console = Console(file=StringIO(), width=100)
    console.print(comparison_table(solution, solution) if compared else solution_table(solution))
    assert isinstance(console.file, StringIO)
    lines = console.file.getvalue().splitlines()
    assert any("± (95 %)" in line for line in lines)
    for quantity, half in (("focal", "3.9"), ("rotation y", "3.9"), ("translation x", "0.98")):
        (row,) = [line for line in lines if quantity in line]
        assert row.split("│")[3].strip() == half, row


def test_share_changes_only_what_it_names():
    """Oracle: the rig's own plan for the other blocks."""
    before = Rig.model_validate({**rig(), "share": {"surface": "per_frame", "centre": "shared"}})
    after = with_sharing(before, "projector_pose=shared, focal=fixed")
    changed = {"projector_pose": "shared", "focal": "fixed"}
    assert after.share.model_dump() == {**before.share.model_dump(), **changed}
    assert after.camera == before.camera


def test_maps_of_one_name_are_told_apart(tmp_path: Path):
    """Oracle: the folders' names; the order is that of the command line."""
    paths = []
    for name, shift in (("b", 0.0), ("a", 1.5)):
        (tmp_path / name).mkdir()
        write(tmp_path / name, map_data=q() + np.float32(shift))
        paths.append(tmp_path / name / "map.npz")
    maps, _ = load_input(paths, tmp_path / "a" / "rig.yaml")
    assert [m.name for m in maps] == ["b/map.npz", "a/map.npz"]
    assert maps[1].q[0, 0, 0] - maps[0].q[0, 0, 0] == 1.5
