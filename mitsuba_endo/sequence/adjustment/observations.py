"""What a frame says of the surface: residuals of coordinates at surface elements, linearised.

A surface element is a point with a normal, which may move along it. Where the ray of the pixel that
shows it meets its plane, a coordinate is predicted; what was observed minus that is the residual,
in two components: along the direction in which the coordinate goes with the range, and across it.
Derivatives are taken at the element, which many frames share, not at the point that the observed
coordinate triangulates to: a noisy point would have its own noise in its derivative, and the
baseline would shrink.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...geometry.projection_models import ProjectorModel
from ...geometry.transforms import RigidTransform
from ...initialisation.vectors import cross, dot
from ...robust import geman_mcclure_weight, robust_std
from ..linearise import Poses, coordinates_at, dot2
from ..placement import FAR
from ..view import ThinnedMap

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

STEEPEST = 0.15
"""Cosine of incidence below which an element is not looked at: 81 degrees."""
AHEAD = 0.99
"""Cosine of the angle, 8 degrees, within which an element lies along the ray of its pixel: a lens
that folds outside the image may project elsewhere what is behind. Chosen."""
REACH = 0.03
"""Distance of the observed surface from an element, parts of the range, beyond which the frame saw
something else. Chosen: ten deviations of a range."""
BLOCKS = (6, 9)
"""Rows and columns of blocks of the image, from one to another of which errors are independent:
wider than a decoder's errors, and many enough for twelve unknowns a frame."""
_LEAST_WEIGHT = 1e-3
"""Below it an observation is left out. Chosen."""


@dataclass(frozen=True, eq=False)
class Elements:
    """Pieces of the surface, in the world."""

    points: Floats
    """(M, 3)."""
    normals: Floats
    """(M, 3) unit, towards the cameras' side."""

    def moved(self, along: Floats) -> "Elements":
        """Return the elements moved along their normals by (M,)."""
        return Elements(self.points + along[:, None] * self.normals, self.normals)


@dataclass(frozen=True, eq=False)
class AdjustedFrame:
    """A frame under adjustment."""

    number: int
    view: ThinnedMap
    poses: Poses
    noise: float
    """Of a coordinate, pattern pixels."""


@dataclass(frozen=True, eq=False)
class Seen:
    """N elements that a frame saw; residuals are over the noise."""

    element: Index
    """(N,) ascending."""
    block: Index
    """(N,) which of the image's :data:`BLOCKS` each lies in."""
    along: Floats
    """(N,) residuals along the direction of the range."""
    by_unknowns: Floats
    """(13, N) derivative of what is predicted there: projector (6), camera in its own axes (6), log
    of the focal length."""
    by_element: Floats
    """(N,) the same by the element's way along its normal."""
    across: Floats
    """(N,) residuals across it."""
    across_by_unknowns: Floats
    """(13, N) likewise; nothing by the camera, whose motion changes the range alone."""
    on_line: Floats
    """(N,) weight of ``across``."""
    weight: Floats
    """(N,) weight of ``along``, below that of ``across``."""
    noise: float
    """Pattern pixels, from the residuals across."""

    def rows(self, chosen: NDArray[np.bool_]) -> "Seen":
        """Return some of the observations."""
        return Seen(
            self.element[chosen], self.block[chosen], self.along[chosen],
            self.by_unknowns[:, chosen], self.by_element[chosen], self.across[chosen],
            self.across_by_unknowns[:, chosen], self.on_line[chosen], self.weight[chosen],
            self.noise,
        )  # fmt: skip


def observe(
    frame: AdjustedFrame, elements: Elements, projector: ProjectorModel, widened: float
) -> Seen:
    """Look at the elements from a frame.

    Args:
        frame: with its poses.
        elements: of the surface.
        projector: with its focal length.
        widened: how many times wider the loss along the range is than that of noise.
    """
    element, pixel, rays, normals, distance = _in_view(frame, elements)
    cosine = dot(normals, rays)
    range_ = distance / cosine
    pose = frame.poses.projector_from_camera
    at = coordinates_at(projector, pose, rays, range_)
    off = frame.view.q.reshape(-1, 2)[pixel].T - at.q
    along, across = dot2(at.tangent, off), dot2(at.normal, off)
    near = at.good & (np.abs(along) < REACH * range_ * at.slope)
    noise = max(robust_std(across[near]), 1e-3) if near.any() else frame.noise
    by_camera = -np.concatenate([cross(rays * range_, normals), normals]) * (at.slope / cosine)
    on_line = np.where(near, geman_mcclure_weight(across / noise / FAR), 0.0)
    observations = Seen(
        element, _blocks(pixel, frame.view.usable.shape), along / noise,
        np.concatenate([at.by_pose(at.tangent), by_camera, at.by_focal(at.tangent)]) / noise,
        at.slope / cosine / noise, across / noise,
        np.concatenate([at.by_pose(at.normal), 0 * by_camera, at.by_focal(at.normal)]) / noise,
        on_line, on_line * geman_mcclure_weight(along / noise / widened / FAR), noise,
    )  # fmt: skip
    return observations.rows(observations.weight > _LEAST_WEIGHT)


def _in_view(
    frame: AdjustedFrame, elements: Elements
) -> tuple[Index, Index, Floats, Floats, Floats]:
    """Return elements (N,), their nearest pixels (N,) and, in the camera's frame, the pixels' rays
    (3, N), the elements' normals (3, N) and the distances (N,) of their planes.
    """
    camera, usable = frame.view.camera, frame.view.usable
    pose: RigidTransform = frame.poses.world_from_camera
    points = pose.inverse().apply(elements.points)
    with np.errstate(all="ignore"):
        column, row = (np.rint(c) for c in camera.project_xyz(*points.T))
        inside = (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
    element = np.flatnonzero(inside)
    pixel = row[element].astype(np.int64) * camera.width + column[element].astype(np.int64)
    rays, points = camera.grid_rays.reshape(-1, 3)[pixel], points[element]
    normals = elements.normals[element] @ pose.R
    led = np.einsum("nk,nk->n", rays, points) > AHEAD * np.linalg.norm(points, axis=1)
    kept = _within(usable).ravel()[pixel] & led & (np.einsum("nk,nk->n", rays, normals) < -STEEPEST)
    rays, normals, points = rays[kept].T, normals[kept].T, points[kept].T
    return element[kept], pixel[kept], rays, normals, dot(normals, points)


def _within(usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Leave out pixels beside one that is not usable: at a depth step they mix its two sides."""
    return cv2.erode(usable.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)


def _blocks(pixel: Index, shape: tuple[int, ...]) -> Index:
    height, width = shape
    row, column = (BLOCKS[0] * (pixel // width)) // height, BLOCKS[1] * (pixel % width) // width
    return BLOCKS[1] * row + column
