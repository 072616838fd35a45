"""The second round: maps read anew against a calibration's geometry, and calibrated again."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..records.calibration import Calibration
from ..records.correspondence import CorrespondenceMap
from ..records.history import Observe
from ..records.rig import Rig
from ..records.solution import Outcome
from ..refine.pattern_image import PatternImage
from ..refine.refine_map import RefinedMap
from ..refine.scene_round import refine_against_scene
from ..solve.calibrate import calibrate
from ..solve.minimisers.minimise import Progress
from ..solve.options import Options
from .known_geometry import known_geometry

WORTH = 0.1
"""Share of the maps' coordinates that must come or go for another solve: with fewer the values move
by a small part of their deviations."""
READING = 0.1
"""Share of the second round's progress that goes by before it solves."""
Picture = NDArray[np.integer] | NDArray[np.floating]
"""(H, W) or (H, W, 3), 8 or 16 bit, or floats where 1 is full scale."""


@dataclass(frozen=True, eq=False)
class SecondRound:
    """Maps after a second look at their photographs."""

    maps: list[CorrespondenceMap]
    """Of all frames, in the order of the first ones; those not read anew as they were."""
    frames: dict[str, RefinedMap]
    """What was found in each photograph that was read anew, by the frame's name."""

    @property
    def change(self) -> float:
        """Coordinates that came or went, over those of the first maps of the frames."""
        moved = sum(f.grown + f.dropped for f in self.frames.values())
        now = sum(int(f.map.valid.sum()) - f.grown + f.dropped for f in self.frames.values())
        return moved / max(now, 1)

    @property
    def worth_solving(self) -> bool:
        """Whether enough has changed for another solve."""
        return self.change > WORTH

    def line(self) -> str:
        """Return one sentence on what was found."""
        read = [f for f in self.frames.values() if not f.reason]
        if not read:
            reasons = {f.reason for f in self.frames.values()}
            why = next(iter(reasons)) if len(reasons) == 1 else "no frame's geometry is known"
            return f"Second round: nothing read anew: {why}."
        grown, dropped = sum(f.grown for f in read), sum(f.dropped for f in read)
        then = "" if self.worth_solving else "; too little to solve again"
        return (
            f"Second round, along the epipolar lines: {grown:,} pixels read that the decoder did "
            f"not, {dropped:,} dropped that contradict the calibration{then}."
        )


def read_again(
    first: Calibration,
    maps: Sequence[CorrespondenceMap],
    pictures: Iterable[tuple[str, Picture]],
    pattern: PatternImage,
    progress: Progress = lambda share, step: None,
) -> SecondRound:
    """Read photographs with the geometry of a calibration from their first maps.

    Args:
        first: the calibration; one that did not converge says nothing, and all maps stay.
        maps: refined on their images.
        pictures: of frames, by the maps' names; others are passed over.
        pattern: that was projected.
        progress: called with the share of the work done and the name of the step.

    Raises:
        InputError: a picture of another size than its map.
    """
    frames: dict[str, RefinedMap] = {}
    named = {m.name: m for m in maps}
    if first.solution.outcome is Outcome.CONVERGED:
        for k, (name, picture) in enumerate(pictures):
            progress(k / max(len(named), 1), f"Reading {name} again")
            map_ = named.get(name)
            geometry = map_ and known_geometry(first.solution, first.camera, map_)
            if map_ and geometry and np.isfinite(geometry.range).any():
                frames[name] = refine_against_scene(map_, picture, pattern, geometry)
    changed = [frames[m.name].map if m.name in frames else m for m in maps]
    return SecondRound(changed, frames)


def second_round(
    first: Calibration,
    maps: Sequence[CorrespondenceMap],
    pictures: Iterable[tuple[str, Picture]],
    pattern: PatternImage,
    rig: Rig,
    options: Options | None = None,
    *,
    masked: Callable[[CorrespondenceMap], CorrespondenceMap] = lambda map_: map_,
    progress: Progress = lambda share, step: None,
    observe: Observe | None = None,
) -> tuple[SecondRound, Calibration]:
    """Read photographs again and calibrate again where that changed enough.

    Args:
        first: calibration of ``maps``.
        maps: refined on their images.
        pictures: of frames, by the maps' names.
        pattern: that was projected.
        rig: what is known.
        options: how to solve.
        masked: takes away pixels that are not to be used.
        progress: called with the share of the work done and the name of the step.
        observe: as for :func:`..solve.calibrate.calibrate`.

    Returns:
        What was read, and its calibration: the first one where too little changed, or where that of
        the maps read anew does not converge.

    Raises:
        InputError: a picture of another size than its map.
    """
    read = read_again(
        first, maps, pictures, pattern, lambda share, step: progress(READING * share, step)
    )
    read = replace(read, maps=[masked(m) for m in read.maps])
    if not read.worth_solving:
        return read, first

    def solving(share: float, step: str) -> None:
        progress(READING + (1 - READING) * share, f"Second round: {step[:1].lower()}{step[1:]}")

    solved = calibrate(read.maps, rig, options, solving, None, observe)
    good = solved.solution.outcome in (Outcome.CONVERGED, Outcome.INTERRUPTED)
    return read, solved if good else first
