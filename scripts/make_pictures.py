"""Make the pictures of the README.

python scripts/make_pictures.py --out docs/images
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from matplotlib.figure import Figure

from mitsuba_endo import backend
from mitsuba_endo.rendering.render import render_capture
from mitsuba_endo.rendering.scene import load_scene, packaged_scenes
from mitsuba_endo.show.figures import save_figure
from mitsuba_endo.show.tonemap import tonemap


def main(out: Annotated[Path, typer.Option(help="Folder to write.")] = Path("docs/images")) -> None:
    """Run the demo for its overview; render every packaged scene."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        demo = Path(folder) / "demo"
        command = [sys.executable, "-m", "mitsuba_endo.cli.main", "demo", "--out", str(demo)]
        subprocess.run([*command, "--quiet"], check=True)
        shutil.copy(demo / "solution" / "overview.png", out / "overview.png")
    backend.use()
    figure = Figure(figsize=(9, 4.9), dpi=90, layout="constrained")
    for axes, name in zip(figure.subplots(2, 3).flat, packaged_scenes(), strict=True):
        capture = render_capture(load_scene(name), spp=64)
        axes.imshow(tonemap(capture.image))
        axes.set_title(name)
        axes.set_axis_off()
    save_figure(out / "scenes.png", figure)


if __name__ == "__main__":
    typer.run(main)
