"""A camera matrix in other units, or of another image than the maps'."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..geometry.cameras import CAMERAS
from ..geometry.cameras.brown_pinhole import OpenCVCamera
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Camera, Rig
from .finding import Finding

MIN_FIELD_DEG = 10.0
"""Degrees over the wider side. Chosen: below are telephoto lenses."""
MAX_FIELD_DEG = 170.0
"""Degrees over the wider side: more than any lens has without a fisheye's model. Chosen."""
MAX_WIDE_FIELD_DEG = 220.0
"""The same for all other models."""
MAX_FOCAL_MM = 60.0
"""Longest focal length in mm of lenses before a machine's or an endoscope's sensor."""
MM_FIELD_DEG = 150.0
"""Degrees from which so small a focal length is more likely in mm than in pixels. Chosen."""
IMPOSSIBLE_FIELD_DEG = 175.0
"""Degrees, without a fisheye's model: the image would be 46 focal lengths wide, 2 tan 87.5."""
OTHER_SIZE = (0.75, 1.3)
"""Side of the image that the principal point is the middle of, over that of the given one, mean of
both axes: within, a principal point may just be off the middle; usual ratios are 2/3 and 4/3."""
ALIKE = 0.2
"""Difference of the logarithms of both axes' ratios up to which it is one ratio."""
NEAR_BORDER = 0.1
"""Share of the image's side, from its border. Chosen."""
FAR_FROM_MIDDLE = 0.25
"""Share of the image's side from its middle, from which a crop is likely. Chosen."""
FITTING = "give that of images of just this size: scale it with the image, shift it with a crop"
NORMALISED_FOCAL, NORMALISED_CENTRE = 10, 1.5
"""A matrix below both is in image widths, not pixels: 10 is a field of 6 degrees."""


def focal_units(_maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Find focal lengths that are not in pixels, and fields of view that no lens has."""
    camera = rig.camera
    fx, fy, cx, cy = _entries(camera)
    field = field_of_view(camera)
    if _normalised(camera):
        return [_finding(
            "camera_normalised",
            f"with fx {fx:g} and centre ({cx:g}, {cy:g}) it looks normalised by the image's size",
            "give pixels: multiply its rows by width and height",
            refused=True,
        )]  # fmt: skip
    if min(fx, fy) < MAX_FOCAL_MM and field > MM_FIELD_DEG and camera.model == OpenCVCamera.name:
        return [_finding(
            "focal_millimetres",
            f"a focal length of {fx:g} px would see {field:.0f} degrees and looks like millimetres",
            "give pixels: millimetres over the size of a pixel",
            refused=field > IMPOSSIBLE_FIELD_DEG,
        )]  # fmt: skip
    widest = MAX_FIELD_DEG if camera.model == OpenCVCamera.name else MAX_WIDE_FIELD_DEG
    if not MIN_FIELD_DEG <= field <= widest:
        return [_finding(
            "field_of_view",
            f"with fx {fx:g} px the {camera.width} x {camera.height} px image spans {field:.3g} "
            "degrees, which hardly any lens does",
            "check that it is in pixels and belongs to images of this size",
        )]  # fmt: skip
    return []


def principal_point(_maps: Sequence[CorrespondenceMap], rig: Rig) -> list[Finding]:
    """Find a camera matrix of another resolution, of an uncropped image, or with a far centre."""
    camera = rig.camera
    if _normalised(camera):
        return []  # told by the other check
    _, _, cx, cy = _entries(camera)
    whole = np.array([2 * cx + 1, 2 * cy + 1])
    ratio = whole / [camera.width, camera.height]
    off = float(np.abs(ratio / 2 - 0.5).max())
    size = f"the {camera.width} x {camera.height} px image"
    at = f"its centre ({cx:g}, {cy:g})"
    if (ratio > 0).all() and _one_other_ratio(ratio):
        return [_finding(
            "camera_resolution",
            f"by {at} it belongs to images of about {whole[0]:.0f} x {whole[1]:.0f} px, not to "
            f"{size}: another resolution, or a crop",
        )]  # fmt: skip
    if off > 0.5 - NEAR_BORDER:
        relation = "beyond" if off > 0.5 else "near"
        return [_finding(
            "principal_point",
            f"{at} lies {relation} the border of {size}: a crop, another resolution or mixed "
            "entries",
        )]  # fmt: skip
    if off > FAR_FROM_MIDDLE:
        return [_finding("camera_crop", f"{at} lies far from the middle of {size}, as of a crop")]
    return []


def field_of_view(camera: Camera) -> float:
    """Return the angle over the image's wider axis about its middle, degrees.

    Models with distortion after the projection leave it out.
    """
    fx, fy, _, _ = _entries(camera)
    half = max(camera.width / fx, camera.height / fy) / 2
    angles = np.radians(np.arange(0, 180, 0.5))
    with np.errstate(all="ignore"):
        reach = np.array([CAMERAS[camera.model].reach(camera.distortion, a) for a in angles])
    rising = int(np.argmin(np.diff(reach, append=-np.inf) > 0)) + 1
    return float(np.degrees(2 * np.interp(half, reach[:rising], angles[:rising])))


def _finding(kind: str, what: str, todo: str = FITTING, refused: bool = False) -> Finding:
    return Finding(kind, what, "camera.K", todo, refused)


def _normalised(camera: Camera) -> bool:
    fx, fy, cx, cy = _entries(camera)
    small = max(fx, fy) < NORMALISED_FOCAL and max(cx, cy) < NORMALISED_CENTRE
    return small and min(cx, cy) > 0 and min(camera.width, camera.height) > 9


def _one_other_ratio(ratio: NDArray[np.float64]) -> bool:
    x, y = np.log(ratio)
    return abs(x - y) < ALIKE and not OTHER_SIZE[0] <= np.exp((x + y) / 2) <= OTHER_SIZE[1]


def _entries(camera: Camera) -> tuple[float, float, float, float]:
    """Return fx, fy, cx, cy, pixels."""
    return camera.K[0][0], camera.K[1][1], camera.K[0][2], camera.K[1][2]
