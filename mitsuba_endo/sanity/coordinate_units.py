"""Coordinates that are counted otherwise, or were rounded on their way."""

from collections.abc import Sequence

import numpy as np

from ..records.correspondence import CorrespondenceMap
from ..records.map_convention import OPTION
from ..records.rig import Rig
from .finding import Finding, frames_named

NORMALISED = 0.98
"""Share of the coordinates between -1 and 1 from which they are normalised: a pattern of more than
twenty pixels spans more."""
LEAST_SIDE = 20
"""Pattern pixels of its shorter side, from which that is told."""
AT_END = 30
"""Coordinates beyond the pattern's last pixel from which it is told. Chosen: outliers are fewer."""
ROUNDED_PX = 0.02
"""Pattern pixels of rounding to half precision, from which it is told: good decoders' errors."""


def normalised(maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Refuse maps whose coordinates lie between 0 and 1, or -1 and 1."""
    if min(rig.projector.width, rig.projector.height) < LEAST_SIDE:
        return []
    frames, signed = [], False
    for map_ in maps:
        q = map_.q[map_.valid]
        if len(q) and (np.abs(q) <= 1).all(-1).mean() >= NORMALISED:
            frames.append(map_.name)
            signed |= bool((q < 0).mean() > 1 - NORMALISED)
    if not frames:
        return []
    words = "normalised,signed" if signed else "normalised"
    return [Finding(
        "map_normalised",
        f"its coordinates lie between {'-1' if signed else '0'} and 1, which looks normalised by "
        "the pattern's size",
        f"{frames_named(frames)}: map",
        f"give pattern pixels, or state {OPTION} {words}",
        refused=len(frames) == len(maps),
    )]  # fmt: skip


def one_based(maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Find maps that begin at 1 and end one beyond the pattern's last pixel."""
    size = np.array([rig.projector.width, rig.projector.height])
    frames = []
    for map_ in maps:
        q = map_.q[map_.valid]
        on = q[((q > -1) & (q < size + 1)).all(-1)]
        beyond = ((on > size - 0.5) & (on < size + 0.5)).sum(0)
        below = (on < 0.5).sum(0)
        if ((beyond >= AT_END) & (below * 10 < beyond)).any() and not (below > beyond).any():
            frames.append(map_.name)
    if not frames:
        return []
    return [Finding(
        "map_one_based",
        "coordinates reach one pixel beyond the pattern and none is 0, as if they were counted "
        "from 1",
        f"{frames_named(frames)}: map",
        f"count from 0, or state {OPTION} one-based",
    )]  # fmt: skip


def half_precision(maps: Sequence[CorrespondenceMap], _rig: Rig) -> list[Finding]:
    """Find maps that were stored in half precision, which rounds large coordinates."""
    rounded = {map_.name: step for map_ in maps if (step := half_step(map_)) > ROUNDED_PX}
    if not rounded:
        return []
    return [Finding(
        "half_precision",
        f"coordinates are rounded by up to {max(rounded.values()):.2g} px, as by half precision",
        f"{frames_named(list(rounded))}: map",
        "store 32-bit floats",
    )]  # fmt: skip


def half_step(map_: CorrespondenceMap) -> float:
    """Return by how much half precision rounded the largest coordinates; 0 if it did not.

    Coordinates that are as coarse everywhere, such as whole numbers, were rounded by a decoder.
    """
    q = np.abs(map_.q[map_.valid]).ravel()
    q = q[q < np.finfo(np.float16).max]
    if not q.size or (q != q.astype(np.float16)).any():
        return 0.0
    step = float(np.spacing(np.float16(np.percentile(q, 99))))
    return 0.0 if (q % step == 0).all() else step / 2
