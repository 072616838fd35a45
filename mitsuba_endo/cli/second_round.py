"""The second round of ``calibrate`` on photographs: the images and maps that it works on."""

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .console import Session

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..records.calibration import Calibration
    from ..records.correspondence import CorrespondenceMap
    from ..records.history import Observe
    from ..records.rig import Rig
    from ..solve.options import Options

ALIKE = 0.9
"""Share of the common coordinates of two maps of one photograph that are alike at least."""
SecondRound = Annotated[
    bool,
    typer.Option(
        "--second-round/--no-second-round",
        help="Read images again along the epipolar lines of their first calibration, and solve "
        "again if that brings or removes a tenth of the coordinates.",
    ),
]


@dataclass(frozen=True)
class Photographs:
    """Images of the coded grid with the maps that were decoded from them."""

    images: list[Path]
    pattern: str | None
    maps: Path
    """Folder of their maps, which are replaced by those that are calibrated."""
    mask: Path | None
    output: Session

    def calibrated_again(
        self, first: "Calibration", maps: list["CorrespondenceMap"], rig: "Rig",
        options: "Options", advance: Callable[[float, str], None], observe: "Observe | None",
    ) -> "Calibration":  # fmt: skip
        """Return the calibration after the second round, and say what that found."""
        from ..decoding.masks import Masks
        from ..refine.image_decoder import grid_of
        from ..refine.pattern_image import grid_image
        from ..rounds.second_round import second_round

        grid = grid_of(self.pattern, rig)
        masks = Masks.at(self.mask) if self.mask else None
        more: dict[str, Any] = {"masked": masks.applied} if masks else {}
        second, calibration = second_round(
            first, maps, self._pictures(), grid_image(grid), rig, options,
            progress=advance, observe=observe, **more,
        )  # fmt: skip
        self.output.print(second.line())
        if calibration is not first:
            for map_ in second.maps:
                self._write(map_, grid.period)
        return calibration

    def _pictures(self) -> Iterator[tuple[str, "NDArray[np.floating]"]]:
        """Yield the images by the names of their maps."""
        from ..decoding.image_files import read_frames
        from .decode import map_path

        for frame in read_frames(self.images):
            yield map_path(self.maps, frame.name).name, frame.image

    def _write(self, map_: "CorrespondenceMap", period: float) -> None:
        from ..records.correspondence import write_map
        from ..records.exr_files import read_exr
        from ..refine.decoded import confidence_of

        path = self.maps / map_.name
        confidence = confidence_of(map_, read_exr(path)["confidence"], period)
        write_map(path, map_, {"confidence": confidence})


def keep_earlier_maps(decoded: Path, earlier: Path) -> None:
    """Replace decoded maps by those that an earlier calibration of the same images ended with.

    After a second round they differ from what is decoded, and only they belong to its state.
    Another image's map of the same name is told by its coordinates, and not taken.
    """
    from ..show.read_folder import DECODED

    for path in decoded.glob("*.exr"):
        kept = earlier / DECODED / path.name
        if kept.is_file() and _alike(path, kept):
            shutil.copyfile(kept, path)


def _alike(a: Path, b: Path) -> bool:
    """Tell whether two maps are of one photograph: common coordinates within a pixel."""
    import numpy as np

    from ..records.correspondence import load_map

    first, second = load_map(a), load_map(b)
    if first.q.shape != second.q.shape:
        return False
    both = first.valid & second.valid
    near = np.abs(first.q[both] - second.q[both]).max(-1, initial=0) < 1
    return bool(near.size) and float(near.mean()) > ALIKE
