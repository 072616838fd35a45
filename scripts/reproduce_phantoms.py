"""Figures 8 and 9: stomach and colon from a fixed front-parallel start, one frame and all.

Every frame starts from the published plane (at the scene's distance) and a projector that looks
the same way, 10 % wrong in focal length. Errors of a decoder as in Table I. RMSE of the
point-to-surface distance in mm over the rays of the first camera that both surfaces meet, after
rigid alignment.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import typer
from matplotlib.figure import Figure
from reproduce.capture import decoded, read_inputs
from reproduce.command import OUT, Out, Quick, Workers
from reproduce.errors import rms_where_all_see, seen
from reproduce.guarded import solvers
from reproduce.methods import LEAN, Reconstruction, reconstruct
from reproduce.pictures import clay, error_maps, shaded
from reproduce.scenes import FOCAL, colon_mesh, stomach_mesh, views_of
from reproduce.tables import Row, save_table

from mitsuba_endo.show.figures import save_figure

PHANTOMS = {"stomach": (stomach_mesh, 8.0), "colon": (colon_mesh, 8.0)}
"""Mesh, and distance of the starting plane in baselines."""


def solve(inputs: Path, plane: float, count: int) -> Reconstruction:
    """Calibrate the first ``count`` frames from the plane."""
    maps, rig = read_inputs(inputs)
    return reconstruct(maps[:count], rig, replace(LEAN, start="plane", plane_distance=plane))


def main(out: Out = OUT / "phantoms", quick: Quick = False, workers: Workers = 2) -> None:
    """Solve both phantoms with one and all frames."""
    frames, width = (2, 96) if quick else (5, 200)
    rows: list[Row] = []
    pictures: dict[str, tuple[list[Any], list[Any]]] = {}
    with solvers(workers) as pool:
        for name, (mesh, plane) in PHANTOMS.items():
            truth = views_of(mesh(1), frames, 1, law="direction_cosine", width=width, play=0.2)
            read = decoded(truth, truth.rig(1.1 * FOCAL), 4, out / "captures" / name)
            running = [pool.submit(solve, read.inputs, plane, n) for n in (1, frames)]
            found = [job.result() for job in running]
            views = [seen(r.surface, truth, "rigid") for r in found]
            for r, view, rmse in zip(found, views, rms_where_all_see(views), strict=True):
                rows.append(
                    {
                        "phantom": name,
                        "frames given": 1 if r is found[0] else frames,
                        "frames used": r.frames,
                        "focal error (%)": 100 * (r.focals[0] / FOCAL - 1),
                        "RMSE (mm)": rmse,
                        "median (mm)": float(np.nanmedian(view.distances)),
                    }
                )
            clays = [shaded(s, truth.camera) for s in (truth.surface, *(r.surface for r in found))]
            pictures[name] = clays, [v.distances for v in views]
    save_table(rows, out, "phantoms")
    save_figure(out / "phantoms.png", picture(pictures, frames))


def picture(pictures: dict[str, tuple[list[Any], list[Any]]], frames: int) -> Figure:
    """Draw true and measured shapes as clay and where they err."""
    figure = Figure(figsize=(15, 5.6), layout="constrained")
    axes = figure.subplots(len(pictures), 5)
    names = ("one frame", f"{frames} frames")
    for row, (name, (clays, errors)) in zip(axes, pictures.items(), strict=True):
        for axis, image, title in zip(row, clays, (f"{name}, truth", *names), strict=False):
            clay(axis, image, title)
        titled = {f"error, {n}": e for n, e in zip(names, errors, strict=True)}
        error_maps(row[3:], titled, 1.5)
    return figure


if __name__ == "__main__":
    typer.run(main)
