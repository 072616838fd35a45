"""Whether a placement can be trusted.

Right ones, in colons and stomachs with errors as of the decoder, have 0.95 to 1.0 of the points in
agreement and a misfit of 0.9 to 1.3; placements a millimetre and three degrees off have 0.3 to 0.7
and 2.5 to 7.
"""

from .placement import Placement

LEAST_OVERLAP = 0.3
"""Share of the correspondences where the map is known."""
LEAST_AGREEMENT = 0.8
"""Share of these within three deviations of the map, between right and wrong placements."""
LARGEST_MISFIT = 2.2
"""Spread of their distances over that of noise, likewise."""
LEAST_ON_LINES = 0.7
"""Share of the correspondences near their epipolar lines."""


def fault(placement: Placement) -> str:
    """Return why a placement cannot be trusted, in words; empty if it can."""
    if placement.on_lines < LEAST_ON_LINES:
        return "its correspondences fit no pose of the projector"
    if placement.overlap < LEAST_OVERLAP:
        return f"only {100 * placement.overlap:.0f} % of it overlaps what was seen before"
    poor = placement.agreement < LEAST_AGREEMENT or placement.misfit > LARGEST_MISFIT
    if poor or not placement.settled:
        return "it fits nowhere on what was seen before"
    return ""
