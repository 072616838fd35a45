from pathlib import Path

import numpy as np
import pytest
from reproduce.capture import TRUTH, capture  # pyright: ignore[reportMissingImports]
from reproduce.decoder_noise import Plain  # pyright: ignore[reportMissingImports]
from reproduce.guarded import solve_each, solvers  # pyright: ignore[reportMissingImports]
from reproduce.scenes import (  # pyright: ignore[reportMissingImports]
    FOCAL,
    stomach_mesh,
    views_of,
)

from tests.reproduce import recorded


def test_solving_never_opens_the_truth(llvm: str, tmp_path: Path) -> None:
    """Oracle: Python's audit events, which tell every file that a process opens.

    The maps and the rig must be among them, or the record itself would be empty.
    """
    truth = views_of(stomach_mesh(0), 1, 0, law="pinhole", width=48, play=0.0)
    seen = capture(truth, truth.rig(1.1 * FOCAL), Plain(0.2).apply, tmp_path / "capture")
    assert (tmp_path / "capture" / TRUTH / "surface.ply").exists()
    ((focal, opened),) = solve_each(recorded.solve, [seen.inputs], workers=1)
    assert np.isfinite(focal)
    ours = [Path(p) for p in opened if str(tmp_path) in p]
    assert {p.name for p in ours} == {"frame_0.npz", "rig.yaml"}
    assert not any(TRUTH in p.parts for p in ours)


def test_a_solver_that_asks_for_the_truth_is_refused(tmp_path: Path) -> None:
    """Oracle: the same read is allowed beside the truth's folder and refused inside it."""
    for folder in (TRUTH, "inputs"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "file.txt").write_text("value")
    with solvers(1) as pool:
        assert pool.submit(recorded.read_text, tmp_path / "inputs" / "file.txt").result() == "value"
        with pytest.raises(PermissionError, match="truth"):
            pool.submit(recorded.read_text, tmp_path / TRUTH / "file.txt").result()
