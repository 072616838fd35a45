"""Handedness of a map: mirrored, with x and y swapped, or with y upwards.

Camera and projector look at the same side of an opaque surface, and both have x to the right and
y downwards: then the determinant of dq/dp, pattern coordinates over camera pixels, is positive
wherever both see the surface, whatever its shape and however the devices are turned.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from .finding import Finding, frames_named

MIRRORED = 0.2
"""Share of positive determinants up to which a map is called mirrored; garbage has a half."""
CELL_PX = 8
"""Side of the cells whose medians are compared: noise and a third of outliers leave their signs."""
MIN_CELLS = 12
"""Fewer signs than this tell nothing."""
MIN_SPREAD = 4
"""Correspondences that a cell must have."""
MIN_COS = np.cos(np.radians(35.0))
"""Alignment with one of the four usual reflections from which it is named."""

REFLECTIONS = {
    "x_mirrored": (np.diag([-1.0, 1.0]), "projector.x runs against the image's x: it is mirrored"),
    "y_upwards": (np.diag([1.0, -1.0]), "projector.y runs upwards, not down"),
    "swapped": (np.array([[0.0, 1], [1, 0]]), "projector.x and projector.y, or rows and columns "
                "of the map, are swapped"),
    "swapped_and_turned": (np.array([[0.0, -1], [-1, 0]]), "projector.x and projector.y are "
                           "swapped and both run backwards"),
}  # fmt: skip
"""dq/dp of an upright camera and projector whose map is wrong, by name, and what to say."""
MENDING = {
    "x_mirrored": "store width - 1 - x (or state --map-convention x-mirrored), or turn off rear "
    "projection or the camera's mirroring",
    "y_upwards": "store height - 1 - y, counted from the pattern's top row, or state "
    "--map-convention y-upwards",
    "swapped": "store x, the pattern's column, first, and index the map by row and column, or "
    "state --map-convention swapped or transposed",
    "swapped_and_turned": "store x, the pattern's column, first, counted from the pattern's left, "
    "or state --map-convention swapped,x-mirrored,y-upwards",
    "mirrored": "check the directions of x and y in the map, and turn off mirroring",
}
WIDE_STEP = 0.25
"""Least area that two steps between cells span, cells squared: less tells no handedness."""


def handedness(maps: Sequence[CorrespondenceMap], _rig: Rig) -> list[Finding]:
    """Refuse maps that no projector before an opaque surface can make, saying how they are turned.

    A projector that shines through a screen is refused as well: the model has no such surface.
    Single frames turned among right ones are a warning: the solver leaves them out by name.
    """
    wrong: dict[str, list[str]] = {}
    for map_ in maps:
        J = local_jacobians(map_)
        if len(J) >= MIN_CELLS and positive_share(J) <= MIRRORED:
            wrong.setdefault(reflection(J), []).append(map_.name)
    return [
        Finding(
            f"handedness_{name}",
            f"{_said(name)} (the map turns the other way round than any opaque surface allows)",
            f"{frames_named(frames)}: map",
            MENDING[name],
            refused=sum(map(len, wrong.values())) == len(maps),
        )
        for name, frames in wrong.items()
    ]


def positive_share(jacobians: NDArray[np.float64]) -> float:
    """Return the share of (N, 2, 2) Jacobians with a positive determinant."""
    return float((np.linalg.det(jacobians) > 0).mean())


def reflection(jacobians: NDArray[np.float64]) -> str:
    """Name the reflection that (N, 2, 2) Jacobians are nearest to, by their mean direction.

    The name supposes that camera and projector are about equally upright; "mirrored" where the
    map lies between two of them.
    """
    size = np.linalg.norm(jacobians, axis=(1, 2), keepdims=True)
    mean = (jacobians / np.maximum(size, 1e-12)).mean(0)
    # Mirror images by a line at any angle: [[cos a, sin a], [sin a, -cos a]].
    mirror = np.array([mean[0, 0] - mean[1, 1], mean[0, 1] + mean[1, 0]])
    mirror /= max(float(np.linalg.norm(mirror)), 1e-12)
    cosines = {n: float(mirror @ [R[0, 0], R[0, 1]]) for n, (R, _) in REFLECTIONS.items()}
    best = max(cosines, key=lambda n: cosines[n])
    return best if cosines[best] >= MIN_COS else "mirrored"


def local_jacobians(map_: CorrespondenceMap) -> NDArray[np.float64]:
    """Return dq/dp (N, 2, 2), pattern pixels per camera pixel, between neighbouring cells.

    Cells are as large as it takes to hold some 16 correspondences; their medians of q and of the
    pixels' places are compared with those of the next to the right and below.
    """
    valid = map_.valid
    height, width = valid.shape
    density = max(float(valid.mean()), 1e-6)
    side = max(CELL_PX, int(np.ceil(np.sqrt(16 / density))))
    side = max(2, min(side, height // 4, width // 4))
    y, x = np.mgrid[:height, :width].astype(np.float32)
    q_and_pixel = np.where(
        valid[..., None], np.concatenate([map_.q, np.stack([x, y], -1)], -1), np.nan
    )
    cells = _cell_medians(q_and_pixel, side)
    right, below = cells[:-1, 1:] - cells[:-1, :-1], cells[1:, :-1] - cells[:-1, :-1]
    steps = np.stack([right, below], -1)
    steps = steps[np.isfinite(steps).all((-1, -2))].astype(np.float64)
    dq, dp = steps[:, :2], steps[:, 2:]
    apart = (np.abs(np.linalg.det(dp)) > WIDE_STEP * side * side) & (np.linalg.det(dq) != 0)
    return dq[apart] @ np.linalg.inv(dp[apart])


def _cell_medians(values: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """Return the medians (H / side, W / side, C) of cells, NaN with too few finite values."""
    rows, columns = values.shape[0] // side, values.shape[1] // side
    cells = values[: rows * side, : columns * side].reshape(rows, side, columns, side, -1)
    cells = np.sort(cells.transpose(0, 2, 4, 1, 3).reshape(rows, columns, values.shape[2], -1), -1)
    count = np.isfinite(cells).sum(-1, keepdims=True)
    middle = np.take_along_axis(cells, np.maximum(count - 1, 0) // 2, -1)
    return np.where(count >= min(MIN_SPREAD, side * side), middle, np.nan)[..., 0]


def _said(name: str) -> str:
    return REFLECTIONS[name][1] if name in REFLECTIONS else "the map is mirrored"
