"""Options of the commands that read correspondence maps: what their numbers mean, what to use."""

from pathlib import Path
from typing import Annotated

import typer

MapConvention = Annotated[
    str,
    typer.Option(
        "--map-convention",
        metavar="WORD,...",
        help="How the maps count and order coordinates, e.g. one-based,y-upwards or missing=-1.",
        show_default=False,
    ),
]
Mask = Annotated[
    Path | None,
    typer.Option(
        help="Image whose white pixels are used, for all frames, or a folder of one per frame.",
        show_default=False,
    ),
]


def mask_files(mask: Path | None) -> list[Path]:
    """Return the files that are read of ``--mask``: those of a folder one by one."""
    if mask is None:
        return []
    return sorted(mask.iterdir()) if mask.is_dir() else [mask]
