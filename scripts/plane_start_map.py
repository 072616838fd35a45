"""Draw from which wrong guesses the published plane start still succeeds.

python scripts/plane_start_map.py --out docs/images/plane_start.png
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from benchmarks.scene import CENTRE, NOISE_PX, TRUE_FOCAL, make_scene
from matplotlib.figure import Figure
from rich.progress import track

from mitsuba_endo import backend
from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Focal
from mitsuba_endo.show.figures import save_figure
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

FOCALS = [0.4, 0.55, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 2.6]
TURNS = [0, 10, 20, 30, 45, 60, 90]
"""Degrees by which the true projector is turned further from the start's, about x, y and z."""
SIZE = (96, 80)
SEEN = 0.5
"""Per cent: a focal length closer than this counts as found."""


def turned_map(degrees: float) -> CorrespondenceMap:
    """Return the sheet's noisy map under a projector turned about the diagonal axis."""
    scene = make_scene(*SIZE)
    axis = np.array([0.3, -0.3, 1.0]) / np.linalg.norm([0.3, -0.3, 1.0])
    pose = RigidTransform.of(np.radians(degrees) * axis, np.zeros(3)) @ scene.true_pose
    rays = scene.camera.grid_rays
    law = projector_model("pinhole", TRUE_FOCAL, CENTRE)
    q = law.project(pose.apply(scene.true_range[..., None] * rays))
    noise = NOISE_PX * np.random.default_rng(0).standard_normal(q.shape)
    return CorrespondenceMap((q + noise).astype(np.float32), f"{degrees} degrees")


def main(out: Annotated[Path, typer.Option()] = Path("docs/images/plane_start.png")) -> None:
    """Calibrate from every pair of focal guess and turn of the projector; draw the error."""
    backend.use()
    rig = make_scene(*SIZE).rig
    # Turned patterns leave the sheet's own pattern; its size is no input of the solver.
    wide = {"width": 4000, "height": 4000}
    error = np.full((len(TURNS), len(FOCALS)), np.nan)
    for row, column in track(list(np.ndindex(error.shape)), "Calibrating"):
        guess = Focal(value=FOCALS[column] * TRUE_FOCAL)
        projector = rig.projector.model_copy(update={"focal": guess, **wide})
        start = Options(start="plane", jackknife=False)
        try:
            found = calibrate(
                [turned_map(TURNS[row])], rig.model_copy(update={"projector": projector}), start
            ).solution.projector.focal.value
        except InputError:
            continue
        if isinstance(found, float):
            error[row, column] = 100 * abs(found / TRUE_FOCAL - 1)
    figure = Figure(figsize=(7, 4.6), layout="constrained")
    axes = figure.subplots()
    axes.imshow(np.where(error < SEEN, 1.0, 0.0), cmap="cividis", aspect="auto", vmin=-0.3, vmax=1)
    for (row, column), value in np.ndenumerate(error):
        text = "null" if np.isnan(value) else f"{value:.2g}"
        axes.text(column, row, text, ha="center", color="black" if value < SEEN else "white")
    axes.set_xticks(range(len(FOCALS)), [f"{f:g}" for f in FOCALS])
    axes.set_yticks(range(len(TURNS)), [f"{d:g}" for d in TURNS])
    axes.set(
        xlabel="guess of the focal length / truth",
        ylabel="turn of the projector, degrees",
        title="Plane start: error of the focal length found, %\n"
        f"{100 * np.mean(error < SEEN):.0f} % of these starts succeed (bright)",
    )
    save_figure(out, figure)


if __name__ == "__main__":
    typer.run(main)
