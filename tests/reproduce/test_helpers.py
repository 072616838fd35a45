import csv
from pathlib import Path

import numpy as np
import pytest
from reproduce.bound import calibration_bound  # pyright: ignore[reportMissingImports]
from reproduce.capture import Truth, pinhole_camera  # pyright: ignore[reportMissingImports]
from reproduce.decoder_noise import (  # pyright: ignore[reportMissingImports]
    DecoderNoise,
    Plain,
    beside_steps,
)
from reproduce.results import found, write_results  # pyright: ignore[reportMissingImports]
from reproduce.scenes import PROJECTOR, SIZE  # pyright: ignore[reportMissingImports]
from reproduce.tables import (  # pyright: ignore[reportMissingImports]
    save_table,
    save_targets,
    spread,
)

from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.shapes.mesh import Mesh

HEIGHT, WIDTH = 70, 90


def smooth_map() -> np.ndarray:
    """Coordinates (H, W, 2) that grow by 5 and 6 pattern pixels a pixel, with one step."""
    x, y = np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float))
    q = np.stack([20 + 5 * x, 15 + 6 * y], -1)
    q[:, 60:, 0] -= 60
    return q


def test_steps_are_found_where_they_are() -> None:
    """Oracle: the map jumps between columns 59 and 60 and nowhere else."""
    columns = np.flatnonzero(beside_steps(smooth_map()).any(0))
    assert columns.tolist() == [59, 60]


def test_line_noise_is_alike_along_a_line_and_not_across() -> None:
    """Oracle: the errors of x one pixel apart along y correlate far more than a period apart in x.

    Six pattern pixels along the line are less than the filter's width of eight; 20 across are more
    than a period of sixteen.
    """
    q = smooth_map()[:, :55]
    noise = DecoderNoise(white=0.0, slips=0.0, missing=0.0, outliers=0.0)
    error = (noise.apply(q, SIZE, np.random.default_rng(3)) - q)[..., 0][1:-1, 1:-1]
    assert np.std(error) == pytest.approx(noise.line * noise.period, rel=0.35)
    along = np.corrcoef(error[:-1].ravel(), error[1:].ravel())[0, 1]
    across = np.corrcoef(error[:, :-4].ravel(), error[:, 4:].ravel())[0, 1]
    assert along > 0.7
    assert abs(across) < 0.3


def test_slips_are_whole_periods_and_missing_patches_are_missing() -> None:
    """Oracle: the shares asked for; patches overshoot by less than the size of one."""
    q = smooth_map()
    noise = DecoderNoise(line=0.0, white=0.0, outliers=0.0, slips=0.05, missing=0.1)
    read = noise.apply(q, SIZE, np.random.default_rng(5))
    far = ~beside_steps(q)
    error = (read - q)[far]
    known = np.isfinite(error).all(-1)
    assert 0.09 < 1 - known.mean() < 0.14
    slipped = np.abs(error[known]).max(-1) > 1
    assert 0.02 < slipped.mean() < 0.1
    assert set(np.round(np.abs(error[known][slipped]).max(-1), 6)) <= {16.0, 32.0}


def test_gross_errors_are_where_they_are_said_to_be() -> None:
    """Oracle: without other noise, the pixels that changed are those of ``gross``."""
    q, noise = smooth_map(), Plain(sigma=0.0, outliers=0.2)
    changed = (noise.apply(q, 7) != q).any(-1)
    np.testing.assert_array_equal(changed, noise.gross((HEIGHT, WIDTH), 7))


def test_the_bound_is_reached_by_least_squares() -> None:
    """Oracle: Monte Carlo. Linear least squares over calibration and every range is efficient.

    The bound eliminates the ranges in closed form; here they are unknowns like the others.
    """
    rng = np.random.default_rng(2)
    points = np.column_stack([rng.uniform(-25, 25, (40, 2)), rng.uniform(40, 80, 40)])
    mesh = Mesh(np.zeros((3, 3)), np.zeros((1, 3), np.int64))
    projector = projector_model("direction_cosine", 300.0, (255.5, 255.5))
    truth = Truth(mesh, pinhole_camera(90, 70, 0.6), projector, SIZE,
                  [RigidTransform.identity()], [PROJECTOR])  # fmt: skip
    sigma, step = 0.3, 1e-5
    bound = calibration_bound(truth, points, sigma)
    columns = [
        (truth.projector.with_(focal=300 * np.exp(s)).project(PROJECTOR.apply(points))).ravel()
        for s in (step, -step)
    ]
    J = [(columns[0] - columns[1]) / (2 * step)]
    for axis in range(5):
        vector = np.zeros(6)
        if axis < 3:
            vector[axis] = step
        else:
            basis = np.linalg.svd(PROJECTOR.t[None])[2][1:]
            vector[3:] = step * np.linalg.norm(PROJECTOR.t) * basis[axis - 3]
        ends = [projector.project(PROJECTOR.perturbed(s * vector).apply(points)) for s in (1, -1)]
        J.append((ends[0] - ends[1]).ravel() / (2 * step))
    ends = [projector.project(PROJECTOR.apply((1 + s) * points)) for s in (step, -step)]
    slope = (ends[0] - ends[1]) / (2 * step)
    ranges = np.zeros((80, 40))
    ranges[np.arange(80), np.repeat(np.arange(40), 2)] = slope.ravel()
    solve = np.linalg.pinv(np.column_stack([*J, ranges]))
    draws = sigma * rng.standard_normal((80, 4000))
    found = (solve @ draws)[0]
    assert bound["focal"] == pytest.approx(100 * found.std(), rel=0.05)


def test_tables_say_the_spread_and_what_failed(tmp_path: Path) -> None:
    """Oracle: by hand."""
    assert spread([3.0, 1.0, np.nan, 2.0]) == "2 (1 to 3), 1 failed"
    save_table([{"a": "x", "b": 0.12345}, {"a": None, "b": 2}], tmp_path, "table")
    assert (
        tmp_path / "table.md"
    ).read_text() == "| a | b |\n| --- | --- |\n| x | 0.123 |\n|  | 2 |\n"
    with (tmp_path / "table.csv").open(newline="") as file:
        assert next(iter(csv.DictReader(file))) == {"a": "x", "b": "0.12345"}


def test_the_page_holds_tables_pictures_and_missed_targets(tmp_path: Path) -> None:
    """Oracle: by hand; a value above its limit is said to be missed."""
    out = tmp_path / "out"
    save_table([{"a": 1}], out, "focal")
    save_targets(out, [("ratio", 0.5, "at most", 0.4), ("share", 0.9, "at least", 0.8)])
    (out / "focal.png").write_bytes(b"picture")
    write_results(tmp_path / "docs" / "results.md", {"focal": ("Title.\n\nWhat it is.", out)})
    page = (tmp_path / "docs" / "results.md").read_text()
    assert "## Title\n\nWhat it is." in page
    assert page.index("## Title") < page.index("## Targets")
    row = {"experiment": "polyp", "figure": "median error (%)", "value": 1.437}
    words = found([row])
    assert "measured on one frame, is off by 1.4 % in the median." in words
    assert found([{**row, "figure": "another"}]) == ""
    assert "| focal | ratio | 0.5 | at most 0.4 | **no** |" in page
    assert "| focal | share | 0.9 | at least 0.8 | yes |" in page
    assert (tmp_path / "docs" / "images" / "results_focal.png").read_bytes() == b"picture"


def test_slips_end_where_few_places_have_room_for_them() -> None:
    """Oracle: one step of two pixels is all there is; discs on it cover less than the share."""
    q = smooth_map()[:, :59]
    q[:, 57:, 0] -= 60
    q[2:] = np.nan
    noise = DecoderNoise(slips=0.5, missing=0.0)
    assert np.isfinite(noise.apply(q, SIZE, np.random.default_rng(1))).any()
