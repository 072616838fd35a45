"""Lens coefficients that fold the image back into itself: pixels beyond the fold have no ray."""

from collections.abc import Sequence

import numpy as np

from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from .finding import Finding

MAX_FOLDED = 0.1
"""Share of the correspondences beyond the fold from which the lens is refused: more than the
corners, to which many a calibration does not reach, is another lens or another image. Chosen."""


def lens_fold(maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Leave out pixels to which the camera's lens model assigns no direction."""
    if not rig.camera.distortion:
        return []
    folded = ~np.isfinite(rig.camera.to_model().grid_rays).all(-1)
    lost = {k: folded & map_.valid for k, map_ in enumerate(maps)}
    lost = {k: pixels for k, pixels in lost.items() if pixels.any()}
    if not lost:
        return []
    most = max(lost, key=lambda k: lost[k].sum())
    count, total = int(lost[most].sum()), int(maps[most].valid.sum())
    return [Finding(
        "lens_fold",
        f"the coefficients fold back inside the image: {count} of {total} correspondences "
        f"({100 * count / total:.2g} %) lie beyond the fold and are left out, and those near it "
        "are doubtful",
        "camera.distortion",
        "calibrate the camera with views up to the corners, or as opencv_fisheye",
        refused=count > MAX_FOLDED * total,
        unusable=lost,
    )]  # fmt: skip
