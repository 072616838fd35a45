"""A scale that implies a working distance which no such rig has: metres for millimetres."""

import numpy as np

from ..records.rig import Rig
from .finding import Finding

BASELINE_MM = (0.5, 5000.0)
"""Least and greatest baseline that is plausible. Chosen: within a tip, across a hall."""
DISTANCE_MM = (5.0, 20000.0)
"""The same of the surface's distance. Chosen: from a tip before tissue to a hall."""
_UNITS = {1000.0: "metres", 10.0: "centimetres", 0.001: "micrometres"}


def working_distance(baseline: float, distance: float, rig: Rig) -> list[Finding]:
    """Find a scale that is implausible; asked after solving, which tells their ratio.

    Args:
        baseline: between camera and projector, mm.
        distance: median range of the seen surface from the camera, mm.
        rig: says where the scale comes from; without one there is nothing to find.
    """
    if rig.scale.kind == "up_to_scale" or not np.isfinite([baseline, distance]).all():
        return []
    if _plausible(baseline, distance):
        return []
    cause = next((f": was it given in {unit}?" for factor, unit in _UNITS.items()
                  if _plausible(factor * baseline, factor * distance)), "")  # fmt: skip
    return [Finding("working_distance", f"a baseline of {baseline:.3g} mm puts the surface at "
                    f"{distance:.3g} mm, which is implausible{cause}", f"scale.{rig.scale.kind}",
                    "give it in mm")]  # fmt: skip


def _plausible(baseline: float, distance: float) -> bool:
    return (
        BASELINE_MM[0] <= baseline <= BASELINE_MM[1]
        and DISTANCE_MM[0] <= distance <= DISTANCE_MM[1]
    )
