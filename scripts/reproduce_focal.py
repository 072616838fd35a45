"""Figure 10: focal length fixed at a wrong value or estimated, from one frame or from four.

The inside of a sphere, which of all shapes tells a DOE projector's focal length worst; the
starting focal length is 10 % too long. Errors of a decoder as in Table I. The cameras of the four
frames start at one place, since a sphere's patches cannot be registered. RMSE of the
point-to-surface distance in mm after rigid alignment, with the first baseline known, for either
projection model.
"""

from itertools import product
from pathlib import Path

import numpy as np
import typer
from reproduce.capture import decoded, read_inputs
from reproduce.command import OUT, Out, Quick, Workers
from reproduce.errors import shape_errors
from reproduce.guarded import solvers
from reproduce.methods import AT_ONE_PLACE, Reconstruction, reconstruct
from reproduce.pictures import bar_groups
from reproduce.scenes import FOCAL, sphere_mesh, views_of
from reproduce.tables import save_table, save_targets, spread

from mitsuba_endo.records.rig import Focal
from mitsuba_endo.show.figures import save_figure

WRONG = 1.1 * FOCAL
CASES = {
    (refine, count): f"{'estimated' if refine else 'fixed'}, {count} frame{'s' * (count > 1)}"
    for refine, count in product((False, True), (1, 4))
}


def solve(inputs: Path, refine: bool, count: int) -> Reconstruction:
    """Calibrate the first ``count`` frames with the focal length fixed or free."""
    maps, rig = read_inputs(inputs)
    projector = rig.projector.model_copy(update={"focal": Focal(value=WRONG, refine=refine)})
    return reconstruct(maps[:count], rig.model_copy(update={"projector": projector}), AT_ONE_PLACE)


def main(out: Out = OUT / "focal", quick: Quick = False, workers: Workers = 2) -> None:
    """Solve all cases over seeds."""
    seeds, width = (1, 64) if quick else (5, 140)
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    with solvers(workers) as pool:
        for law, seed in product(("pinhole", "direction_cosine"), range(seeds)):
            truth = views_of(sphere_mesh(), 4, seed, law=law, width=width, play=0.2)
            folder = out / "captures" / f"{law}_{seed}"
            read = decoded(truth, truth.rig(WRONG), 2000 + seed, folder)
            running = {c: pool.submit(solve, read.inputs, *c) for c in CASES}
            for case, job in running.items():
                r = job.result()
                focal = 100 * (r.focals[0] / FOCAL - 1)
                rmse = shape_errors(r.surface, truth, "rigid").rmse
                found.setdefault((law, CASES[case]), []).append((rmse, focal))
    best = CASES[True, 4]
    rows = [
        {
            "law": law,
            "focal length": case,
            "RMSE (mm)": spread([v[0] for v in values]),
            "focal error (%)": spread([v[1] for v in values], 2),
            "RMSE / fixed, 1 frame": float(
                np.median([a[0] / b[0] for a, b in zip(values, found[law, CASES[False, 1]],
                                                       strict=True)])
            ),
        }
        for (law, case), values in found.items()
    ]  # fmt: skip
    save_table(rows, out, "focal")
    ratio = {(r["law"], r["focal length"]): r["RMSE / fixed, 1 frame"] for r in rows}
    save_targets(
        out,
        [
            (f"{law}: {best} / {other}", ratio[law, best] / ratio[law, case], "at most", limit)
            for law in ("pinhole", "direction_cosine")
            for case, other, limit in ((CASES[False, 1], "fixed, 1 frame", 0.25),
                                       (CASES[True, 1], "estimated, 1 frame", 1.0))
        ],
    )  # fmt: skip
    rmse = {key: [v[0] for v in values] for key, values in found.items()}
    save_figure(out / "focal.png", bar_groups(rmse, "RMSE (mm)"))


if __name__ == "__main__":
    typer.run(main)
