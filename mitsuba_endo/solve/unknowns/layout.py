"""Which unknowns there are, who shares them, and where each stands in the vector of unknowns.

A block is ``fixed``, ``shared`` by all frames or ``per_frame``. Surfaces are no part of the vector:
they are eliminated from the normal equations.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...errors import InputError
from ...records.rig import Rig, Sharing
from .block import BLOCKS, Block, Floats, Value
from .gauge import Gauge
from .state import State


@dataclass(frozen=True, eq=False)
class Layout:
    """Owners of every block's values over the frames of a problem."""

    frames: int
    surface_of: tuple[int, ...]
    """Index of the surface that every frame sees."""
    owners: Mapping[str, tuple[int, ...]]
    """Of every block, which value each frame has."""
    free: Mapping[str, bool]
    """Of every block, whether its values are unknowns."""
    given: Mapping[str, Value | None]
    """Of every block, the value that the rig gives, if any: the only one where it is not free."""
    names: Mapping[str, tuple[str, ...]]
    """What people call the components of a step of every block."""
    gauge: Gauge = field(default_factory=Gauge)

    @property
    def surfaces(self) -> int:
        """Number of surfaces."""
        return max(self.surface_of) + 1

    @cached_property
    def slots(self) -> dict[tuple[str, int], slice]:
        """Columns of every unknown value (block, owner)."""
        slots, start = {}, 0
        for name in BLOCKS:
            for owner in sorted(set(self.owners[name])) if self.free[name] else []:
                if width := self._unknowns(name, owner):
                    slots[name, owner] = slice(start, start + width)
                    start += width
        return slots

    @cached_property
    def widths(self) -> dict[str, int]:
        """Number of components of a step of every block."""
        return {name: len(parts) for name, parts in self.names.items()}

    @property
    def columns(self) -> int:
        """Number of unknowns G besides the surfaces."""
        return max((s.stop for s in self.slots.values()), default=0)

    def owner(self, name: str, frame: int) -> int:
        """Return which value of a block a frame has."""
        return self.owners[name][frame]

    def slot(self, name: str, frame: int) -> slice | None:
        """Return the columns of a frame's value of a block, or None where it is no unknown."""
        return self.slots.get((name, self.owner(name, frame)))

    def active(self, frame: int) -> tuple[str, ...]:
        """Return the blocks of which a frame needs derivatives."""
        return tuple(name for name in BLOCKS if self.slot(name, frame) is not None)

    def rows(self, name: str, frame: int) -> slice:
        """Return where an active block stands among a frame's own components."""
        start = 0
        for other in self.active(frame):
            if other == name:
                break
            start += self.widths[other]
        return slice(start, start + self.widths[name])

    def sharing(self, name: str) -> Sharing:
        """Return how the frames have a block."""
        if not self.free[name]:
            return "fixed"
        return "shared" if len(set(self.owners[name])) == 1 else "per_frame"

    def tangent_map(self, state: State, name: str, owner: int) -> Floats:
        """Return T (width, unknowns) of one value: step of the value = T unknowns."""
        return self.gauge.tangent_map(name, owner, state.values[name][owner], self.widths[name])

    def local_from_global(self, state: State, frame: int) -> Floats:
        """Return T (components of a frame, G): steps of its active blocks = T step."""
        rows = [np.zeros((0, self.columns))]
        for name in self.active(frame):
            part = np.zeros((self.widths[name], self.columns))
            owner = self.owner(name, frame)
            part[:, self.slots[name, owner]] = self.tangent_map(state, name, owner)
            rows.append(part)
        return np.concatenate(rows)

    def retract(self, state: State, step: Floats) -> State:
        """Return the state with its values moved by a step (G,); surfaces stay."""
        values = {name: list(of_block) for name, of_block in state.values.items()}
        for (name, owner), slot in self.slots.items():
            before = state.values[name][owner]
            local = self.tangent_map(state, name, owner) @ step[slot]
            values[name][owner] = self.gauge.retract(BLOCKS[name], owner, before, local)
        return replace(state, values={name: tuple(v) for name, v in values.items()})

    def difference(self, state: State, other: State) -> Floats:
        """Return the step (G,) that leads from one state towards another."""
        out = np.zeros(self.columns)
        for (name, owner), slot in self.slots.items():
            before, after = (s.values[name][owner] for s in (state, other))
            step = BLOCKS[name].difference(before, after)
            out[slot] = self.tangent_map(state, name, owner).T @ step
        return out

    def state(self, surfaces: Sequence[Floats], of_frames: Mapping[str, Sequence[Value]]) -> State:
        """Return a state from a value of every block for each frame.

        Frames that share get the mean of theirs; what the rig fixes is written last.
        """
        return State(
            tuple(surfaces),
            {name: self._values(block, of_frames.get(name)) for name, block in BLOCKS.items()},
            self.owners,
        )

    def _values(self, block: Block, of_frames: Sequence[Value] | None) -> tuple[Value, ...]:
        """Return the value of every owner of a block."""
        owners, given = self.owners[block.name], self.given[block.name]
        if not self.free[block.name] or of_frames is None:
            return (given,) * (max(owners) + 1)
        own = [[v for v, o in zip(of_frames, owners, strict=True) if o == k] for k in set(owners)]
        return tuple(_common(block, values) for values in own)

    def held(self) -> "Layout":
        """Return the layout with every value known and only the surfaces unknown."""
        return replace(self, free=dict.fromkeys(self.free, False))

    def alone(self, frame: int = 0) -> "Layout":
        """Return the layout of one frame by itself."""
        first = dict.fromkeys(self.owners, (0,))
        free = {n: f and n != "camera_pose" for n, f in self.free.items()}
        lengths = frozenset({0}) if self.gauge.unit_lengths else frozenset()
        return replace(
            self, frames=1, surface_of=(0,), owners=first, free=free, gauge=Gauge(0, lengths)
        )

    def _unknowns(self, name: str, owner: int) -> int:
        if self.gauge.is_origin(name, owner):
            return 0
        return self.widths[name] - self.gauge.holds_length(name, owner)


def _common(block: Block, values: list[Value]) -> Value:
    """Return one value for frames that came to their own; an only one as it is."""
    return values[0] if len(values) == 1 else block.mean(values)


def make_layout(rig: Rig, frames: int) -> Layout:
    """Resolve the sharing plan of a rig file for a number of frames.

    Raises:
        InputError: the plan contradicts itself or lacks a value for a fixed block.
    """
    modes: dict[str, Sharing] = {name: block.sharing(rig) for name, block in BLOCKS.items()}
    _check(rig, modes, frames)
    given = {name: block.given(rig) for name, block in BLOCKS.items()}
    own_surfaces = rig.share.surface == "per_frame"
    names = {name: block.names(rig) for name, block in BLOCKS.items()}
    owners, free = {}, {}
    for name, mode in modes.items():
        owners[name] = tuple(range(frames)) if mode == "per_frame" else (0,) * frames
        free[name] = mode != "fixed" and bool(names[name])
    return Layout(
        frames, tuple(range(frames)) if own_surfaces else (0,) * frames, owners, free, given,
        names, _gauge(owners["projector_pose"], free["projector_pose"], own_surfaces),
    )  # fmt: skip


def _gauge(projectors: tuple[int, ...], free: bool, own_surfaces: bool) -> Gauge:
    """Return the gauge: without a common surface every projector pose has its own unit."""
    if not free:
        return Gauge(unit_lengths=frozenset())
    return Gauge(unit_lengths=frozenset(projectors if own_surfaces else projectors[:1]))


def _check(rig: Rig, modes: Mapping[str, Sharing], frames: int) -> None:
    several, shared_surface = frames > 1, rig.share.surface == "shared"
    for name, mode in modes.items():
        if mode not in BLOCKS[name].modes:
            raise InputError(
                f"cannot be {mode}", f"share.{name}", f"use {' or '.join(BLOCKS[name].modes)}"
            )
    if rig.share.surface == "fixed":
        raise InputError("the surface cannot be fixed", "share.surface", "use shared or per_frame")
    if modes["camera_pose"] == "shared" and several:
        raise InputError(
            "one camera pose for all frames is a fixed camera", "share.camera_pose",
            "use per_frame, or surface=per_frame for a fixed rig over several scenes",
        )  # fmt: skip
    for name, key in (("projector_pose", "projector.pose"), ("focal", "projector.focal.value")):
        if modes[name] == "fixed" and BLOCKS[name].given(rig) is None:
            raise InputError(f"is fixed but {key} is not given", f"share.{name}", f"add {key}")
    if shared_surface and modes["camera_pose"] == "fixed" and several:
        raise InputError(
            "one surface for all frames needs their camera poses, which are fixed and not given",
            "share.camera_pose", "use camera_pose=per_frame or surface=per_frame",
        )  # fmt: skip
    if rig.drift is not None and modes["projector_pose"] != "per_frame":
        raise InputError(
            "drift is given but the projector pose is not per frame", "drift",
            "use share.projector_pose: per_frame or remove drift",
        )  # fmt: skip
