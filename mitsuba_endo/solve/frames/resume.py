"""Stopping an optimisation and going on with it later."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...records.checkpoint import Checkpoint, SurfaceRecord, devices_of
from ...records.correspondence import CorrespondenceMap
from ...records.rig import AUTO_LAW, Rig
from ..costs.objective import Problem, make_problem
from ..costs.registry import priors_of
from ..costs.smoothness import smoothness
from ..minimisers.result import OptimisationResult
from ..surfaces.registry import SURFACES
from ..unknowns.block import BLOCKS, PoseBlock, Value
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .initial_state import observations


def checkpoint_of(result: OptimisationResult, rig: Rig) -> Checkpoint:
    """Describe a result, or where an interrupted optimisation stood; the rig is what was given."""
    problem, state = result.problem, result.state
    used = []
    for frame in problem.observed:
        mask = np.zeros(frame.shape, bool)
        mask[frame.pixels[:, 1], frame.pixels[:, 0]] = True
        used.append(mask)
    return Checkpoint(
        law=problem.law,
        devices=devices_of(rig),
        last_stage=result.noise.last,
        names=[f.name for f in problem.observed],
        used=used,
        surfaces=[
            SurfaceRecord(
                surface.kind, surface.record(), values, term.weight, term.disparity
            )
            for surface, values, term in zip(
                problem.surfaces, state.surfaces, problem.smoothness, strict=True
            )
        ],
        values={name: [_array(v) for v in values] for name, values in state.values.items()},
    )  # fmt: skip


def check_rig(checkpoint: Checkpoint, rig: Rig) -> None:
    """Refuse another camera, pattern or projection model than the checkpoint was made with.

    Its surfaces and the correspondences that it leaves out were chosen for them, so that the way
    on would end elsewhere than a calibration anew. Scale, priors and what is known may differ.

    Raises:
        InputError: names the entry of the rig.
    """
    again = "give the same rig, or start anew without --resume"
    if checkpoint.devices != devices_of(rig):
        raise InputError(
            "the earlier calibration was of another camera or size of the pattern",
            "camera, projector", again,
        )  # fmt: skip
    if rig.projector.law not in (AUTO_LAW, checkpoint.law):
        what = f"the earlier calibration was with {checkpoint.law}, not {rig.projector.law}"
        raise InputError(what, "projector.law", again)


def resumed_problem(
    checkpoint: Checkpoint,
    maps: Sequence[CorrespondenceMap],
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
) -> tuple[Problem, State]:
    """Rebuild the problem of a checkpoint from its maps.

    Raises:
        InputError: the plan asks for other surfaces or another sharing than the checkpoint has.
    """
    if layout.surfaces != len(checkpoint.surfaces):
        raise InputError(
            f"the earlier calibration had {len(checkpoint.surfaces)} surfaces and the plan asks "
            f"for {layout.surfaces}", "share.surface", "resume with the same plan, or start anew",
        )  # fmt: skip
    frames = [observations(m, used, camera) for m, used in zip(maps, checkpoint.used, strict=True)]
    surfaces = [SURFACES[s.kind].from_record(s.arrays) for s in checkpoint.surfaces]
    smooth = [
        smoothness(surface, i, s.weight, s.disparity)
        for i, (surface, s) in enumerate(zip(surfaces, checkpoint.surfaces, strict=True))
    ]
    of_frames = {name: _of_frames(checkpoint, name, layout.frames) for name in checkpoint.values}
    state = layout.state([s.values for s in checkpoint.surfaces], of_frames)
    terms = [*smooth, *priors_of(rig, layout)]
    return make_problem(frames, surfaces, state, layout, checkpoint.law, terms), state


def resumed_maps(
    checkpoint: Checkpoint, maps: Sequence[CorrespondenceMap]
) -> list[CorrespondenceMap]:
    """Return the maps of the checkpoint's frames, in its order.

    Raises:
        InputError: a frame is not among the maps, or has another size.
    """
    named = {m.name: m for m in maps}
    out = []
    for name, used in zip(checkpoint.names, checkpoint.used, strict=True):
        if name not in named:
            raise InputError("a frame of the earlier calibration is missing", name, "give its map")
        if named[name].q.shape[:2] != used.shape or not named[name].valid[used].all():
            raise InputError("is not the map of the earlier calibration", name, "give that map")
        out.append(named[name])
    return out


def _of_frames(checkpoint: Checkpoint, name: str, frames: int) -> list[Value]:
    """Return the value of a block for every frame; one value serves all."""
    values = checkpoint.values[name]
    own = [_value(name, v) for v in values]
    return own if len(own) == frames else [own[0]] * frames


def _array(value: Value) -> NDArray[np.float64]:
    return value.matrix() if isinstance(value, RigidTransform) else value


def _value(name: str, array: NDArray[np.float64]) -> Value:
    if isinstance(BLOCKS.get(name), PoseBlock):
        return RigidTransform(array[:3, :3], array[:3, 3])
    return array
