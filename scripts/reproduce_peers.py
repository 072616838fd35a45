"""Peers on the same correspondences, from the same wrong focal length.

One frame of the stomach phantom under either projection model, 0.3 px Gaussian noise and 1 % gross
errors, focal length 10 % too long. **pycolmap**: bundle adjustment with the projector as a pinhole
camera, and as a fisheye camera frozen to the sine law. **epipolar**: this package's start alone, a
robust fit of the epipolar geometry, and triangulation. **Adam**: the published method. Errors are
root mean squares over seeds; beside those of the calibration is how many times the Cramer-Rao
bound (every pixel's range free, inliers alone) they are. Points: median distance from the true
surface over pixels without gross error, nothing aligned. Time: median over the seeds after a first
run that compiles. Memory: peak of a process that runs this method alone.
"""

import numpy as np
import typer
from reproduce import peers
from reproduce.bound import calibration_bound
from reproduce.capture import capture
from reproduce.command import OUT, Out, Quick, need
from reproduce.decoder_noise import Plain
from reproduce.guarded import answer, solvers
from reproduce.peer_errors import calibration_errors, lit_points, point_error
from reproduce.pictures import peer_bars
from reproduce.scenes import FOCAL, stomach_mesh, views_of
from reproduce.tables import save_table

from mitsuba_endo.show.figures import save_figure

METHODS = {
    "ours": peers.ours,
    "Adam, as published": peers.adam,
    "pycolmap, pinhole": peers.pycolmap_pinhole,
    "pycolmap, sine fisheye": peers.pycolmap_fisheye,
    "epipolar + triangulation": peers.epipolar,
}
PROJECTION_MODELS = ("pinhole", "direction_cosine")


def main(out: Out = OUT / "peers", quick: Quick = False) -> None:
    """Let every peer solve all captures, one after the other in a process of its own."""
    need("pycolmap")
    seeds, width = (2, 48) if quick else (5, 140)
    noise = Plain(sigma=0.3, outliers=0.01)
    truths, captures = {}, {}
    for law in PROJECTION_MODELS:
        for seed in range(seeds):
            truth = views_of(stomach_mesh(seed), 1, seed, law=law, width=width, play=0.0)
            folder = out / "captures" / f"{law}_{seed}"
            truths[law, seed] = truth
            captures[law, seed] = capture(
                truth, truth.rig(1.1 * FOCAL), lambda q, _, s=seed: noise.apply(q, s), folder
            )
    rows = []
    for name, method in METHODS.items():
        with solvers(1) as pool:
            answers = {k: answer(pool.submit(method, c.inputs)) for k, c in captures.items()}
        found = {k: f for k, f in answers.items() if f is not None}
        for law in PROJECTION_MODELS:
            mine = {k: f for k, f in found.items() if k[0] == law}
            if not mine:
                continue
            errors = np.array([calibration_errors(f, truths[k]) for k, f in mine.items()])
            bounds = np.array(
                [list(calibration_bound(truths[k], lit_points(truths[k]), 0.3).values())
                 for k in mine]
            )  # fmt: skip
            rms = np.sqrt(np.mean(errors**2, axis=0))
            times = rms / np.sqrt(np.mean(bounds**2, axis=0))
            points = [point_error(f, truths[k], noise, k[1]) for k, f in mine.items()]
            seconds = [f.seconds for f in mine.values()]
            rows.append(
                {
                    "law": law.replace("_", " "),
                    "method": name,
                    "answers": f"{len(mine)} of {seeds}",
                    "focal (%)": float(rms[0]),
                    "focal / bound": float(times[0]),
                    "rotation (deg)": float(rms[1]),
                    "rotation / bound": float(times[1]),
                    "direction (deg)": float(rms[2]),
                    "direction / bound": float(times[2]),
                    "points (mm)": float(np.median(points)),
                    "time (s)": float(np.median(seconds[1:] or seconds)),
                    "memory (MB)": max(f.memory_mb for f in found.values()),
                }
            )
    rows.sort(key=lambda row: row["law"])
    save_table(rows, out, "peers")
    save_figure(out / "peers.png", peer_bars(rows, ("focal / bound", "points (mm)", "time (s)")))


if __name__ == "__main__":
    typer.run(main)
