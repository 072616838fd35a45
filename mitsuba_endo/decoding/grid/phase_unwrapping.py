"""Phase unwrapping: the wrapped phase of each pixel plus the fringe order of its region.

Regions are those within which the phase does not wrap. One with an assigned node has that node's
column and row as its fringe order; between neighbouring regions the phase wraps, so the order of
one tells that of the other.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..network import Heads
from .grid_graph import GridNodes, larger, phase_slope
from .node_assignment import NodeAssignment
from .settings import MatcherSettings

UNKNOWN = np.iinfo(np.int32).min // 2
"""Fringe order of a region that has none."""


@dataclass(frozen=True, eq=False)
class _Regions:
    """Regions of an image and the pairs of pixels on their borders."""

    number: NDArray[np.int32]
    """(H, W) region of each pixel, 0 = none."""
    count: int
    """Regions, with 0."""
    first: NDArray[np.intp]
    """(P,) flat index of a pixel."""
    second: NDArray[np.intp]
    """(P,) flat index of its right or lower neighbour in another region."""
    step: NDArray[np.intp]
    """(P, 2) fringe order of the second pixel's region less that of the first's."""

    def across(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return the regions (P,) on both sides of the borders."""
        flat = self.number.ravel()
        return flat[self.first], flat[self.second]


def unwrap(
    heads: Heads, nodes: GridNodes, assignment: NodeAssignment, settings: MatcherSettings
) -> NDArray[np.float32]:
    """Return column and row (H, W, 2) in the pattern, continuous; NaN where not known.

    Args:
        heads: of the image.
        nodes: of the image.
        assignment: which of them are which.
        settings: thresholds.
    """
    usable = heads.confidence > settings.pixel_confidence
    usable &= heads.edge < settings.pixel_edge
    usable &= larger(larger(phase_slope(heads.phase))) < settings.pixel_slope
    regions = _find_regions(heads.phase, usable, settings.region_step)
    order, closed = _orders_of_nodes(regions, nodes, assignment)
    for _ in range(settings.spread_rounds):
        order = _spread(regions, order, closed, settings.spread_share)
    resolved = (order[:, 0] != UNKNOWN)[regions.number] & usable
    resolved &= ~_contradicted(regions, order, settings.conflict_margin)
    lattice = assignment.turn * (order[regions.number] + heads.phase)
    lattice = np.where(resolved[..., None], lattice, np.nan).astype(np.float32)
    return smoothed_by_planes(lattice, heads.confidence, settings)


def _find_regions(
    phase: NDArray[np.float32], usable: NDArray[np.bool_], most: float
) -> _Regions:  # fmt: skip
    """Label the regions of a phase (H, W, 2), periods, among the usable pixels."""
    height, width = usable.shape
    # Pixels lie at even places, links between neighbours at the odd places between them.
    mask = np.zeros((2 * height - 1, 2 * width - 1), np.uint8)
    mask[::2, ::2] = usable
    index = np.arange(usable.size).reshape(height, width)
    borders = []
    for axis, linked in ((1, mask[::2, 1::2]), (0, mask[1::2, ::2])):
        ahead = (slice(None), slice(1, None)) if axis else (slice(1, None), slice(None))
        behind = (slice(None), slice(-1)) if axis else (slice(-1), slice(None))
        difference = phase[ahead] - phase[behind]
        wraps = np.rint(difference)
        smooth = (larger(difference - wraps) < most) & usable[ahead] & usable[behind]
        within = larger(wraps) == 0
        linked[:] = smooth & within
        border = smooth & ~within
        borders.append((index[behind][border], index[ahead][border], -wraps[border]))
    count, label = cv2.connectedComponents(mask, connectivity=4, ltype=cv2.CV_32S)
    first, second, step = (np.concatenate(parts) for parts in zip(*borders, strict=True))
    number = np.ascontiguousarray(label[::2, ::2], dtype=np.int32)
    return _Regions(number, count, first, second, step.astype(np.intp))


def _orders_of_nodes(
    regions: _Regions, nodes: GridNodes, assignment: NodeAssignment
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the fringe order (C, 2) of each region with assigned nodes, and regions (C,) closed.

    Closed are regions of nodes that were refused, and of nodes that contradict each other.
    """
    region, assigned = regions.number[nodes.pixel], assignment.assigned
    order = np.full((regions.count, 2), UNKNOWN)
    closed = np.zeros(regions.count, bool)
    # Upside down, the phase runs against the pattern: count nodes along the phase.
    at, wanted = region[assigned], (assignment.turn * assignment.node)[assigned]
    order[at] = wanted
    closed[region[~assigned]] = True
    # Of several nodes in a region the last one was written: the others must agree with it.
    closed[at[(order[at] != wanted).any(1)]] = True
    closed[0] = True
    order[closed] = UNKNOWN
    return order, closed


def _spread(
    regions: _Regions, order: NDArray[np.intp], closed: NDArray[np.bool_], share: float
) -> NDArray[np.intp]:
    """Give regions the order that at least this share of their border to known ones asks for."""
    first, second = regions.across()
    source = np.concatenate([first, second])
    target = np.concatenate([second, first])
    step = np.concatenate([regions.step, -regions.step])
    open_ = (order[source, 0] != UNKNOWN) & (order[target, 0] == UNKNOWN) & ~closed[target]
    target, wanted = target[open_], (order[source] + step)[open_]
    if not len(target):
        return order
    rows, votes = np.unique(np.column_stack([target, wanted]), axis=0, return_counts=True)
    total = np.bincount(rows[:, 0], votes, minlength=regions.count)
    won = votes >= share * total[rows[:, 0]]
    order = order.copy()
    order[rows[won, 0]] = rows[won, 1:]
    return order


def _contradicted(
    regions: _Regions, order: NDArray[np.intp], margin: int
) -> NDArray[np.bool_]:  # fmt: skip
    """Return the pixels (H, W) beside borders whose regions' orders do not fit the phase."""
    first, second = (order[region] for region in regions.across())
    both = (first[:, 0] != UNKNOWN) & (second[:, 0] != UNKNOWN)
    wrong = both & (second - first != regions.step).any(1)
    mask = np.zeros(regions.number.shape, np.uint8)
    mask.ravel()[regions.first[wrong]] = 1
    mask.ravel()[regions.second[wrong]] = 1
    return cv2.dilate(mask, np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)).astype(bool)


def smoothed_by_planes(
    lattice: NDArray[np.float32], confidence: NDArray[np.float32], settings: MatcherSettings
) -> NDArray[np.float32]:
    """Return column and row (H, W, 2) with less noise where the network is less sure.

    A plane is fitted to the known pixels around each, weighted by a Gaussian window and by the
    square of the confidence (local linear regression; W. Cleveland and S. Devlin, "Locally weighted
    regression", 1988). NaN stays NaN.

    Args:
        lattice: (H, W, 2) column and row; NaN where not known.
        confidence: (H, W) probability that the network's phase is right.
        settings: thresholds.
    """
    valid = np.isfinite(lattice[..., 0])
    weight = np.where(valid, confidence**2, 0).astype(np.float32)
    low, high = settings.plane_confidence
    share = np.where(valid, np.clip((high - confidence) / (high - low), 0, 1), 0)
    values = np.where(valid[..., None], lattice, 0)
    plane, residual = _fitted_planes(values, weight, settings)
    change = plane - values
    share[(larger(change) > settings.plane_change) | (residual > settings.plane_residual)] = 0
    return (lattice + share[..., None] * change).astype(np.float32)


def _fitted_planes(
    values: NDArray[np.float32], weight: NDArray[np.float32], settings: MatcherSettings
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the plane's value (H, W, 2) at each pixel, and the larger standard deviation off it.

    The second one is (H, W), over both axes.
    """
    sigma = settings.plane_sigma

    def moment(image: NDArray[np.float32], of_x: int, of_y: int) -> NDArray[np.float32]:
        return _moment(image, of_x, of_y, sigma)

    total = np.maximum(moment(weight, 0, 0), np.float32(1e-6))
    x, y = moment(weight, 1, 0) / total, moment(weight, 0, 1) / total
    ridge = np.float32(settings.plane_ridge * sigma**2)
    xx = moment(weight, 2, 0) / total - x * x + ridge
    yy = moment(weight, 0, 2) / total - y * y + ridge
    xy = moment(weight, 1, 1) / total - x * y
    determinant = xx * yy - xy * xy
    planes, variances = [], []
    for value in np.ascontiguousarray(values.transpose(2, 0, 1)):
        weighted = weight * value
        mean = moment(weighted, 0, 0) / total
        by_x = moment(weighted, 1, 0) / total - x * mean
        by_y = moment(weighted, 0, 1) / total - y * mean
        slope_x = (yy * by_x - xy * by_y) / determinant
        slope_y = (xx * by_y - xy * by_x) / determinant
        planes.append(mean - slope_x * x - slope_y * y)
        variance = moment(weighted * value, 0, 0) / total - mean * mean
        variances.append(variance - slope_x * by_x - slope_y * by_y)
    return np.stack(planes, -1), np.sqrt(np.maximum(np.maximum(*variances), 0))


def _moment(
    image: NDArray[np.float32], of_x: int, of_y: int, sigma: float
) -> NDArray[np.float32]:  # fmt: skip
    """Return the sums (H, W) over a Gaussian window of image dx^of_x dy^of_y."""
    away = np.arange(-np.ceil(2.5 * sigma), np.ceil(2.5 * sigma) + 1)
    window = np.exp(-0.5 * (away / sigma) ** 2)
    window /= window.sum()
    across, down = (window * away**power for power in (of_x, of_y))
    border = cv2.BORDER_CONSTANT
    sums = cv2.sepFilter2D(image, cv2.CV_32F, across, down, borderType=border)
    return np.asarray(sums, np.float32)
