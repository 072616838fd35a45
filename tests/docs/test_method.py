"""The method's table of formulas against the folder tree."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "method.md").read_text("utf-8")
TABLE = PAGE[PAGE.index("## Where each formula is") :]


def files_of(table: str) -> dict[str, list[str]]:
    """Files of each row of a table, by its formula."""
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    rows = [line.strip("|").rsplit(" | ", 1) for line in lines]
    return {formula.strip(): re.findall(r"`([^`]+)`", files) for formula, files in rows}


def missing(table: str) -> list[str]:
    """Files that a table names and the package lacks, and formulas without any."""
    found = files_of(table)
    absent = [f for files in found.values() for f in files if not is_module(f)]
    return absent + [formula for formula, files in found.items() if not files]


def is_module(name: str) -> bool:
    return name.endswith(".py") and (ROOT / "mitsuba_endo" / name).is_file()


def test_every_formula_has_a_file_that_exists() -> None:
    """Oracle: the folder tree."""
    assert len(files_of(TABLE)) >= 20
    assert missing(TABLE) == []


def test_what_is_missing_is_noticed() -> None:
    """Oracle: by hand; one file is there, one is not, one formula has none."""
    table = (
        "| F | At |\n|--|--|\n| $a$ | `geometry/transforms.py`, `geometry/b.py` |\n| $c$ | in C |"
    )
    assert missing(table) == ["geometry/b.py", "$c$"]


def test_symbols_of_the_pages_equations_are_in_the_table() -> None:
    """Oracle: what the page's displayed equations define."""
    for symbol in (
        r"\varrho",
        r"\rho",
        r"\sigma",
        "X^0",
        "A^{-1}",
        "I^{-1}",
        r"\alpha",
        r"\lambda",
    ):
        assert symbol in PAGE.split("## Where")[0]
        assert symbol in TABLE


TERMS = {
    "transforms": "Y = R", "projection_models": "projection models", "brown_distortion": "Brown",
    "fisheye": "camera pixel", "ray_triangle": "meets a triangle",
    "projector_coordinates": "R(S, C, P)", "inverse_range": r"X = d / \rho",
    "triangle_mesh": "X = X^0", "edge_bending": "$b_j$ of a mesh",
    "edge_length": "length of a mesh",
    "tsdf": "truncated signed", "objective": "$E$", "noise_scale": r"$\sigma$ of one",
    "coordinate_residual": r"L^{-1}(q - R)", "robust_loss": r"$\varrho$ and its weights",
    "smoothness": r"\lambda \sum", "gaussian_prior": r"\bar v_m", "linearisation": "Jacobian",
    "normal_equations": "$J^T W J$", "schur": r"(G - B^T A^{-1} B)", "cholesky": "banded Cholesky",
    "damping": "damping", "adam": "step of Adam", "ransac": "five-point RANSAC",
    "epipolar_residual": r"\partial e/\partial q", "triangulat": "range from two rays",
    "icp": "point-to-plane", "kannala_brandt": "Kannala and Brandt",
    "levenberg_marquardt": r"\mathrm{diag} H", "score_test": "score tests",
    "nuisance": r"S (Q + m m^T) S^T", "structure": "structure of residuals",
    "design_effect": "design effect", "phase_shift": "phase shifting",
    "heterodyne": "none of which spans", "gray_code": "Gray code", "gap_code": "gap code",
    "regression": "image refinement", "epipolar_focal": "$f$ from", "cluster_cov": "as clusters",
    "trajectory_err": "trajectory errors", "alignment": "trajectory errors",
    "sandwich": "simulation extrapolation", "jackknife": "jackknife",
}  # fmt: skip
"""Words that a textbook uses for what a row of the table computes."""


@pytest.mark.parametrize("word", TERMS)
def test_a_textbooks_word_leads_to_the_formula(word: str) -> None:
    """Oracle: the folder tree: one file is called so, and it is the one of the table's row."""
    package = ROOT / "mitsuba_endo"
    called = [p.relative_to(package).as_posix() for p in package.rglob(f"*{word}*.py")]
    assert len(called) == 1
    (row,) = [files for formula, files in files_of(TABLE).items() if TERMS[word] in formula]
    assert called[0] in row
