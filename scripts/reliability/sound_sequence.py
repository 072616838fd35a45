"""A small sequence with its state, as the commands leave it."""

import shutil
from pathlib import Path

from .commands import run

FRAMES = 6
SCENE = ("--set", "width=64", "--set", "height=48", "--set", "fx=45.3", "--set", "cx=32.1",
         "--set", "cy=23.6")  # fmt: skip


def _sequence(folder: Path) -> None:
    """Render a recording, track it, and put maps and rig beside what was found."""
    run(folder, "render", "stomach", "--trajectory", "withdrawal", "--frames", str(FRAMES),
        "--out", "recording", *SCENE)  # fmt: skip
    run(folder, "sequence", "recording/maps", "--rig", "recording/rig.yaml", "--out", "found",
        "--quiet")  # fmt: skip
    for path in list((folder / "found").iterdir()):
        path.rename(folder / path.name)
    (folder / "recording" / "maps").rename(folder / "maps")
    for name in ("found", "recording", "tmp"):
        shutil.rmtree(folder / name)


SEQUENCE = {"sequence": _sequence}
"""Makers by the names of what they make."""
