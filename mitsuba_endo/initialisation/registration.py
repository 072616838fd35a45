"""Registration of frames that look at one rigid surface, each known up to its own scale.

Neighbours are registered first, frames that fail are tried against others, and loops are checked.
A frame that fits nowhere is reported with the reason, never joined: one wrong frame ruins the
joint solve.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.transforms import RigidTransform

from .frame_graph import ChainedFrame, FrameGraph
from .range_image import RangeImage, RangePyramid, typical_range
from .registration_quality import PairRegistration

__all__ = ["RangeImage", "Registration", "register_frames"]

EMPTY = "hardly any of its range image is usable"


@dataclass(frozen=True, eq=False)
class Registration:
    """Where one frame is, or why that is not known.

    The world is the camera frame of the first frame of the largest group of frames that fit one
    another (the first of all frames, as a rule), in units of that frame's baseline.
    """

    world_from_camera: RigidTransform
    """In the world's unit; NaN where not reliable."""
    scale: float
    """Multiplies the frame's own lengths to give the world's; NaN where not reliable."""
    residual: float
    """Robust standard deviation of the point-to-plane distance relative to the median range, of
    the best placement found; 0 for the world's own frame, infinite where there is none."""
    overlap: float
    """Share of the frame's points that found a partner under it; 1 for that frame."""
    reliable: bool
    reason: str
    """Empty if reliable, else why the frame must be left out."""


def register_frames(
    images: Sequence[RangeImage],
    *,
    seed: int = 0,
) -> list[Registration]:
    """Place all frames in one world.

    Neighbouring frames may be some 25 mm and 15 degrees apart at a distance of 70 mm, in any
    direction, and their units may differ by some 15 %. No guess is needed. Placements are chained,
    not adjusted over loops: errors of some 0.4 degrees and 0.8 % of the range a step add up.

    Args:
        images: range images, each in its own unit (its baseline).
        seed: fixes the random starts and samples; the same seed gives the same result.

    Returns:
        One registration for each image, in order.

    Raises:
        InputError: no frames, or none with a usable range image.
    """
    if not images:
        raise InputError("there are no frames to register", todo="give at least one")
    units = np.array([typical_range(image) for image in images])
    # A frame without a single range gets a unit from the others, and is then found unusable.
    unit = float(np.median(units[np.isfinite(units)])) if np.isfinite(units).any() else 1.0
    frames = [RangePyramid(image, unit) for image in images]
    if not any(frame.usable for frame in frames):
        raise InputError(
            "no frame has a usable range image", todo="check the correspondence maps of the frames"
        )
    graph = FrameGraph(frames, np.random.default_rng(seed))
    graph.connect()
    graph.check_loops()
    return _collect(graph, unit)


def _collect(graph: FrameGraph, unit: float) -> list[Registration]:
    group = graph.largest_group()
    chained = graph.chained_frames(group[0])
    return [
        _registration(chained[k], unit, is_world=k == group[0])
        if k in chained
        else _left_out(graph, k, group)
        for k in range(len(graph.frames))
    ]


def _registration(frame: ChainedFrame, unit: float, *, is_world: bool) -> Registration:
    where, fit = frame.root_from_frame, frame.last.fit
    pose = RigidTransform(where.R[0], unit * where.t[0])
    residual, overlap = (0.0, 1.0) if is_world else (fit.residual, fit.overlap[0])
    return Registration(pose, float(where.s[0]), residual, overlap, True, "")


def _left_out(graph: FrameGraph, k: int, group: list[int]) -> Registration:
    """Report frame ``k`` by the attempt that came nearest to working."""
    nowhere = RigidTransform(np.full((3, 3), np.nan), np.full(3, np.nan))
    attempts = graph.attempts(k, group)
    best = min(attempts.values(), key=lambda p: p.fit.residual, default=PairRegistration())
    fit = best.fit
    return Registration(
        nowhere, float("nan"), fit.residual, fit.overlap[0], False, _reason(graph, k, group)
    )


def _reason(graph: FrameGraph, k: int, group: list[int]) -> str:
    if not graph.frames[k].usable:
        return EMPTY
    said = [f"against frame {j}: {fault}" for j, fault in graph.faults(k, group).items()]
    mates = [str(j) for j in graph.group_of(k) if j != k]
    if mates:
        said.append(f"it fits only frame{'s' * (len(mates) > 1)} {', '.join(mates)}")
    return "; ".join(said) or "it fits none of the frames that it was compared with"
