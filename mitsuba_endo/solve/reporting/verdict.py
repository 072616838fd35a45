"""The verdict: what was measured and what was not, in sentences."""

import numpy as np

from ...records.solution import INTERVAL, Alternative, Estimate, PoseEstimate, Solution
from ..unknowns.block import BLOCKS
from .estimates import listed
from .grouping import alike

_FEW = 3
"""Frames up to which every pose has a sentence of its own."""


def verdict(solution: Solution, refuted: str = "") -> list[str]:
    """Return one sentence for each unknown, the most important first.

    Args:
        solution: all but its verdict.
        refuted: why the sharing plan is wrong, which comes before everything else.
    """
    unit = solution.units if solution.units == "mm" else "baselines"
    out = [f"Plan: wrong; {refuted}."] if refuted else []
    out.append(_scale(solution))
    out += _projection_model(solution) + _intrinsics(solution)
    first = solution.frames[0].projector_from_camera
    several = any(f.projector_from_camera != first for f in solution.frames)
    if len(solution.frames) > _FEW:
        out += _all_poses(solution, several, unit)
    for frame in solution.frames if len(solution.frames) <= _FEW else []:
        where = f" of {frame.name}" if len(solution.frames) > 1 else ""
        if several or frame is solution.frames[0]:
            named = f"Projector pose{where if several else ''}"
            out += _pose(named, frame.projector_from_camera, unit)
        if frame.world_from_camera.status != "fixed":
            out += _pose(f"Camera pose{where}", frame.world_from_camera, unit)
    if "conclusion" in solution.model:
        out.append(f"Model: {solution.model['conclusion']}.")
    return out + [_alternative(solution, a) for a in solution.alternatives]


def _all_poses(solution: Solution, several: bool, unit: str) -> list[str]:
    """Return a sentence for the poses of each device, and one for each reason to be wary."""
    projectors = [(f.name, f.projector_from_camera) for f in solution.frames]
    cameras = [(f.name, f.world_from_camera) for f in solution.frames]
    out = [] if several else _pose("Projector pose", projectors[0][1], unit)
    for device, poses in (("Projector", projectors if several else []), ("Camera", cameras)):
        poses = [(name, pose) for name, pose in poses if pose.status != "fixed"]
        deviations = [pose.std for _, pose in poses if pose.t is not None and pose.std is not None]
        if deviations:
            turned, moved = (INTERVAL * np.array([max(s[p]) for s in deviations])
                             for p in (np.s_[:3], np.s_[3:]))  # fmt: skip
            out.append(
                f"{device} poses of {len(deviations)} frames: translations within ± "
                f"{np.median(moved):.2g} {unit} (at most {moved.max():.2g}), rotations within ± "
                f"{np.degrees(np.median(turned)):.2g} degrees (95 %); each is in frames.csv."
            )
        wary = {}
        for name, pose in poses:
            if pose.status in ("weak", "unobservable"):
                wary.setdefault((pose.status, alike(pose.reason or "")), []).append((name, pose))
        for (status, _), group in wary.items():
            how = "only weakly determined" if status == "weak" else "not determined"
            names = listed([name for name, _ in group])
            out.append(f"{device} poses of {names}: {how}; {group[0][1].reason}.")
    return out


def _alternative(solution: Solution, other: Alternative) -> str:
    every = len(other.frames) == len(solution.frames)
    where = "" if every else f" of {', '.join(other.frames)}"
    return f"Alternative projector pose{where}: {other.reason}."


def _scale(solution: Solution) -> str:
    if solution.scale == "up_to_scale":
        return "Scale: unknown; lengths are multiples of the first baseline."
    source = solution.scale.replace("_", " ")
    spread = (
        f", known to {solution.scale_std_percent:.2g} % (one standard deviation)"
        if solution.scale_std_percent
        else ""
    )
    return f"Scale: lengths are in mm, from the {source}{spread}."


def _projection_model(solution: Solution) -> list[str]:
    """Say which projection model was chosen and by how much, where several were compared."""
    conclusion = solution.law_evidence.get("conclusion")
    return [f"Projection model: {conclusion}."] if conclusion else []


def _intrinsics(solution: Solution) -> list[str]:
    projector = solution.projector
    out = []
    named = {
        "Focal length": projector.focal, "Projector centre": projector.centre,
        "Aspect ratio": projector.aspect, "Projector distortion": projector.distortion,
    }  # fmt: skip
    for name, estimate in named.items():
        px = " px" if name in ("Focal length", "Projector centre") else ""
        if estimate.status != "fixed":
            out.append(_estimate(name, estimate, px))
    for name, estimate in solution.blocks.items():
        block = BLOCKS[name]
        unit = f" {block.unit}" if block.unit else ""
        out.append(_estimate(block.words[0].upper() + block.words[1:], estimate, unit))
    if projector.focal.status == "fixed":
        out.insert(0, f"Focal length: {projector.focal.value:.6g} px, given and not estimated.")
    return out


def _estimate(name: str, estimate: Estimate, unit: str) -> str:
    if estimate.value is None or estimate.std is None:
        return f"{name}: not determined; {estimate.reason}."
    values = estimate.value if isinstance(estimate.value, list) else [estimate.value]
    stds = estimate.std if isinstance(estimate.std, list) else [estimate.std]
    text = ", ".join(
        f"{v:.6g} ± {INTERVAL * s:.2g}{unit}" for v, s in zip(values, stds, strict=True)
    )
    weak = f"; only weakly determined, {estimate.reason}" if estimate.status == "weak" else ""
    return f"{name}: {text} (95 %){weak}."


def _pose(name: str, pose: PoseEstimate, unit: str) -> list[str]:
    if pose.status == "fixed":
        return [f"{name}: given and not estimated."]
    if pose.R is None or pose.t is None or pose.std is None:
        return [f"{name}: not determined; {pose.reason}."]
    angle = float(np.degrees(INTERVAL * max(pose.std[:3])))
    length = INTERVAL * max(pose.std[3:])
    t = ", ".join(f"{x:.4g}" for x in pose.t)
    weak = f"; only weakly determined, {pose.reason}" if pose.status == "weak" else ""
    return [
        f"{name}: t = ({t}) {unit}, each within ± {length:.2g} {unit}; rotation within "
        f"± {angle:.2g} degrees (95 %){weak}."
    ]
