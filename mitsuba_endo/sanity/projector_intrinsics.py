"""A projector centre that nobody gave, and a projector focal length in other units."""

from collections.abc import Sequence

from ..geometry.laws import Pinhole
from ..records.correspondence import CorrespondenceMap
from ..records.rig import AUTO_LAW, Rig
from .finding import Finding

MIN_FOCAL = 0.05
"""Of the pattern's width: a projector that spreads over 168 degrees."""


def assumed_centre(_maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Say that the centre of a projector with a lens was assumed.

    A diffractive projector's zero order is the middle of its pattern; a lens is often shifted.
    """
    projector = rig.projector
    lens = projector.law in (Pinhole.name, AUTO_LAW)
    if projector.centre is not None or not lens:
        return []
    x, y = projector.middle
    return [Finding("centre_assumed", f"not given, so it is assumed in the middle of the pattern, "
                    f"({x:g}, {y:g}); of many projectors with a lens it lies at the lower edge or "
                    "below, and a wrong one spoils focal length and pose", "projector.centre",
                    "give it if it is known")]  # fmt: skip


def projector_focal(_maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Find a given focal length that is far too short for pattern pixels."""
    value = rig.projector.focal.value
    if value is None or value >= MIN_FOCAL * rig.projector.width:
        return []
    return [Finding("projector_focal_millimetres", f"{value:g} px is tiny beside a pattern of "
                    f"{rig.projector.width} px and looks like millimetres", "projector.focal",
                    "give it in pattern pixels, or leave it out to have it found")]  # fmt: skip
