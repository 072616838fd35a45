"""Figure 6: a rabbit, errors added to projector pose and focal length, one frame and two.

Exact coordinates with 0.1 px noise. The calibration that is known beforehand is wrong: the
projector 1.5 degrees and 0.5 mm off, the focal length 10 % too long. One frame is calibrated from
the published start, a plane and a front-parallel projector. The second frame sees the rabbit from
another place with the projector moved in its channel: solved alone its scale is that of an assumed
baseline, solved together with the first it must agree. RMSE of the point-to-surface distance in
mm, nothing aligned (the first baseline is known).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import typer
from reproduce.capture import capture, read_inputs
from reproduce.clouds import cloud, clouds_picture, distances, frame_scale, triangulated
from reproduce.command import OUT, Out, Quick
from reproduce.decoder_noise import Plain
from reproduce.guarded import solvers
from reproduce.methods import LEAN, focal_of
from reproduce.scenes import FOCAL, rabbit_mesh, views_of
from reproduce.tables import save_table

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.show.figures import save_figure
from mitsuba_endo.solve.calibrate import calibrate

WRONG_FOCAL = 1.1 * FOCAL
WRONG_POSE = RigidTransform.of([0.015, -0.02, 0.01], [0.3, -0.2, 0.3])
PLANE = replace(LEAN, start="plane", plane_distance=8.0)
"""50 mm in baselines."""


def solve(inputs: Path, frames: slice, plane: bool) -> Calibration:
    """Calibrate some of the frames, from the plane or by the default search."""
    maps, rig = read_inputs(inputs)
    return calibrate(maps[frames], rig, PLANE if plane else LEAN)


def main(out: Out = OUT / "simulation", quick: Quick = False) -> None:
    """Calibrate, compare and draw."""
    truth = views_of(rabbit_mesh(), 2, 3, law="direction_cosine", width=120 if quick else 220,
                     play=1.0)  # fmt: skip
    seen = capture(truth, truth.rig(WRONG_FOCAL), Plain(0.1).apply, out / "capture")
    with solvers(1) as pool:
        one, second, both = (
            pool.submit(solve, seen.inputs, *case).result()
            for case in ((slice(0, 1), True), (slice(1, 2), False), (slice(0, 2), False))
        )
    focals = [focal_of(c) for c in (one, both)]
    clouds = {
        "uncalibrated": triangulated(seen.inputs, WRONG_POSE, truth),
        "one frame": cloud(one.surface, truth),
        "two frames": cloud(both.surface, truth),
    }
    rows = []
    for (name, points), focal in zip(clouds.items(), (WRONG_FOCAL, *focals), strict=True):
        off = distances(points, truth)
        rows.append(
            {
                "calibration": name,
                "focal error (%)": 100 * (focal / FOCAL - 1),
                "RMSE (mm)": float(np.sqrt(np.mean(off**2))),
                "median (mm)": float(np.median(off)),
            }
        )
    save_table(rows, out, "simulation")
    scales = [
        {
            "frames": name,
            "size of frame 1 / true": frame_scale(first, truth, 0),
            "size of frame 2 / true": frame_scale(other, truth, 1),
        }
        for name, first, other in (("each alone", one, second), ("together", both, both))
    ]
    save_table(scales, out, "simulation_scale")
    save_figure(out / "simulation.png", clouds_picture(clouds, truth))


if __name__ == "__main__":
    typer.run(main)
