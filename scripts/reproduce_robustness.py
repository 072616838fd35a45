"""Robustness: errors against noise, gross errors, missing data, baseline, frames and wrong start.

The stomach phantom under the pinhole law, so that pycolmap's model is right too; 0.3 px noise and
a focal length 10 % too long unless that is what changes. Medians over seeds of the absolute focal
error and of the points' distance from the true surface (pixels without gross error). With several
frames, whose projectors move, pycolmap's bundle adjustment has no correspondences between frames:
it is drawn for one. A point is left out where a method gives nothing.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import typer
from reproduce import peers
from reproduce.capture import Truth
from reproduce.command import OUT, Out, Quick, Workers, need
from reproduce.conditions import CURVES, Condition
from reproduce.decoder_noise import Plain
from reproduce.guarded import answer, solvers
from reproduce.peer_errors import calibration_errors, point_error
from reproduce.pictures import curves
from reproduce.tables import save_table

from mitsuba_endo.show.figures import save_figure

METHODS = {
    "ours": peers.ours, "Adam": partial(peers.adam, iterations=1500),
    "pycolmap": peers.pycolmap_pinhole,
}  # fmt: skip
TITLES = ("focal error (%)", "distance of the points (mm)")


def main(out: Out = OUT / "robustness", quick: Quick = False, workers: Workers = 2) -> None:
    """Draw all curves."""
    need("pycolmap")
    seeds, width, length = (1, 48, 2) if quick else (3, 96, None)
    rows = []
    with solvers(workers) as pool:
        for what, (label, values) in CURVES.items():
            if quick and what not in ("sigma", "guess"):
                continue
            found: dict[str, list[tuple[float, float, float]]] = {}
            for value in values[:length]:
                condition = replace(Condition(), **{what: value})
                cases = [
                    condition.capture(s, width, out / "captures" / f"{what}_{value}_{s}")
                    for s in range(seeds)
                ]
                for name, method in METHODS.items():
                    if name == "pycolmap" and condition.frames > 1:
                        continue
                    jobs = [pool.submit(method, c.inputs) for _, c in cases]
                    errors = [
                        _errors(job, t, condition.noise, 10 * s) for s, (job, (t, _)) in
                        enumerate(zip(jobs, cases, strict=True))
                    ]  # fmt: skip
                    focal, points = np.median(np.array(errors), axis=0)
                    found.setdefault(name, []).append((value, focal, points))
                    rows.append({"against": label, "value": value, "method": name,
                                 TITLES[0]: float(focal), TITLES[1]: float(points)})  # fmt: skip
            save_figure(out / f"robustness_{what}.png", curves(found, label, TITLES))
    save_table(rows, out, "robustness")


def _errors(job: Any, truth: Truth, noise: Plain, seed: int) -> tuple[float, float]:
    """Return both errors; where a method gives up it is infinitely wrong."""
    found = answer(job)
    if found is None:
        return np.inf, np.inf
    return abs(calibration_errors(found, truth)[0]), point_error(found, truth, noise, seed)


if __name__ == "__main__":
    typer.run(main)
