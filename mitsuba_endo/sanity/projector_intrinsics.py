"""A projector's focal length in other units than pattern pixels."""

from collections.abc import Sequence

from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from .finding import Finding

MIN_FOCAL = 0.05
"""Of the pattern's width: a projector that spreads over 168 degrees."""


def projector_focal(_maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Find a given focal length that is far too short for pattern pixels."""
    value = rig.projector.focal.value
    if value is None or value >= MIN_FOCAL * rig.projector.width:
        return []
    return [Finding("projector_focal_millimetres", f"{value:g} px is tiny beside a pattern of "
                    f"{rig.projector.width} px and looks like millimetres", "projector.focal",
                    "give it in pattern pixels, or leave it out to have it found")]  # fmt: skip
