"""Figures of benchmarks that are run in pieces."""

from dataclasses import replace
from pathlib import Path

from scripts.benchmarks.report import Figure, renewed, save, saved

A = Figure("sequence", "colon: surface", 0.1, "mm", "lower", 0.25)
B = Figure("sequence", "stomach: surface", 0.3, "mm", "lower", 0.25)


def test_figures_of_earlier_pieces_are_kept(tmp_path: Path) -> None:
    """Oracle: by hand; what was measured anew stands where it stood."""
    assert saved(tmp_path) == []
    save([A, B], tmp_path)
    assert saved(tmp_path) == [A, B]
    new = replace(A, value=0.2)
    other = replace(B, benchmark="bundle")
    assert renewed(saved(tmp_path), [new, other]) == [new, B, other]


def test_a_target_is_reached_on_the_better_side() -> None:
    assert A.reached
    assert not B.reached
    assert not replace(A, better="higher").reached
    assert replace(A, target=None).reached is None
    assert not replace(A, value=float("nan")).reached
