"""Which unknowns there are, and where each stands in the vector of global unknowns.

A block of unknowns is ``fixed``, ``shared`` by all frames or ``per_frame``. The surface is not
part of this vector: it is eliminated from the normal equations.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...geometry.transforms import tangent_basis
from ...records.rig import Rig, Sharing
from .state import INTRINSICS, State

SIZES = {
    "camera_pose": 6,
    "projector_pose": 6,
    **{name: part.stop - part.start for name, part in INTRINSICS.items()},
}
"""Number of local columns of every block of one frame, in their order."""


@dataclass(frozen=True)
class Plan:
    """Sharing of every block over the frames of a problem."""

    frames: int
    surface: Sharing
    blocks: dict[str, Sharing]
    """For each key of :data:`SIZES`."""
    distortion_terms: int = 0
    """Number of projector distortion coefficients that are unknowns if their block is."""
    free_scale: bool = True
    """Whether lengths are free, so that the length of one translation must be held."""
    _slots: dict[tuple[str, int], slice] = field(default_factory=dict)

    def __post_init__(self) -> None:
        start = 0
        for name in SIZES:
            owners = {"fixed": [], "shared": [0], "per_frame": range(self.frames)}
            for frame in owners[self.blocks[name]]:
                width = self._width(name, frame)
                if width:
                    self._slots[name, frame] = slice(start, start + width)
                    start += width

    @property
    def columns(self) -> int:
        """Number of global unknowns."""
        return max((s.stop for s in self._slots.values()), default=0)

    @property
    def slots(self) -> dict[tuple[str, int], slice]:
        """Global columns of every block instance (name, frame)."""
        return self._slots

    def owner(self, name: str, frame: int) -> int:
        """Return the frame whose columns ``frame`` uses for block ``name``."""
        return 0 if self.blocks[name] == "shared" else frame

    def slot(self, name: str, frame: int) -> slice | None:
        """Return the global columns that ``frame`` uses for block ``name``, or None."""
        return self._slots.get((name, self.owner(name, frame)))

    def active(self, frame: int) -> tuple[str, ...]:
        """Return the blocks of which ``frame`` needs derivatives."""
        return tuple(name for name in SIZES if self.slot(name, frame) is not None)

    def surface_of(self, frame: int) -> int:
        """Return the index of the surface that ``frame`` sees."""
        return frame if self.surface == "per_frame" else 0

    @property
    def surfaces(self) -> int:
        """Number of surfaces."""
        return self.frames if self.surface == "per_frame" else 1

    def holds_length(self, name: str, frame: int) -> bool:
        """Tell whether this translation's length is the unit of length of its surface."""
        if name != "projector_pose" or not self.free_scale:
            return False
        per_frame = self.blocks[name] == "per_frame" and self.surface == "per_frame"
        return frame == 0 or per_frame

    def local_to_global(self, state: State, frame: int) -> NDArray[np.float64]:
        """Return T (local columns of ``frame``, global columns): d local = T d global.

        Where a translation's length is held, its step has two components, perpendicular to it.
        """
        rows = []
        for name in self.active(frame):
            slot = self.slot(name, frame)
            assert slot is not None
            block = np.zeros((self.local_width(name), self.columns))
            block[:, slot] = self.chart(state, name, frame)
            rows.append(block)
        return np.concatenate(rows) if rows else np.zeros((0, self.columns))

    def step_local(
        self, state: State, name: str, frame: int, step: NDArray[np.float64]
    ) -> NDArray[np.float64] | None:
        """Return the local step of a block for a global one, or None where it is fixed."""
        slot = self.slot(name, frame)
        return None if slot is None else self.chart(state, name, frame) @ step[slot]

    def local_width(self, name: str) -> int:
        """Return the number of local columns of a block."""
        return self.distortion_terms if name == "distortion" else SIZES[name]

    def chart(self, state: State, name: str, frame: int) -> NDArray[np.float64]:
        """Return the (local width, global width) derivative of a block's local step."""
        if not self.holds_length(name, self.owner(name, frame)):
            return np.eye(self.local_width(name))
        chart = np.zeros((6, 5))
        chart[:3, :3] = np.eye(3)
        chart[3:, 3:] = tangent_basis(state.projector_from_camera[frame].t)
        return chart

    def _width(self, name: str, frame: int) -> int:
        if name == "camera_pose" and frame == 0:
            return 0  # the first camera's frame is the world
        return 5 if self.holds_length(name, frame) else self.local_width(name)


def make_plan(rig: Rig, frames: int) -> Plan:
    """Resolve the sharing plan of a rig file for a number of frames.

    Raises:
        InputError: the plan contradicts itself or lacks a value for a fixed block.
    """
    share = rig.share
    focal = share.focal or ("shared" if rig.projector.focal.refine else "fixed")
    blocks: dict[str, Sharing] = {
        "camera_pose": "fixed" if share.surface == "per_frame" else share.camera_pose,
        "projector_pose": share.projector_pose,
        "focal": focal,
        "centre": share.centre,
        "aspect": share.aspect,
        "distortion": share.distortion,
    }
    _check(rig, blocks, frames)
    terms = max(len(rig.projector.distortion), 2) if share.distortion != "fixed" else 0
    if blocks["distortion"] != "fixed" and terms == 0:
        blocks["distortion"] = "fixed"
    return Plan(
        frames, share.surface, blocks, terms, free_scale=blocks["projector_pose"] != "fixed"
    )


def _check(rig: Rig, blocks: dict[str, Sharing], frames: int) -> None:
    if rig.share.surface == "fixed":
        raise InputError("the surface cannot be fixed", "share.surface", "use shared or per_frame")
    if blocks["camera_pose"] == "shared" and frames > 1:
        raise InputError(
            "one camera pose for all frames is a fixed camera", "share.camera_pose",
            "use per_frame, or surface=per_frame for a fixed rig over several scenes",
        )  # fmt: skip
    if blocks["projector_pose"] == "fixed" and rig.projector.pose is None:
        raise InputError(
            "is fixed but projector.pose is not given", "share.projector_pose", "add projector.pose"
        )
    if blocks["focal"] == "fixed" and rig.projector.focal.value is None:
        raise InputError(
            "is fixed but projector.focal.value is not given", "share.focal", "add the value"
        )
    if rig.share.surface == "shared" and blocks["camera_pose"] == "fixed" and frames > 1:
        raise InputError(
            "one surface for all frames needs their camera poses, which are fixed and not given",
            "share.camera_pose", "use camera_pose=per_frame or surface=per_frame",
        )  # fmt: skip
    if rig.drift is not None and blocks["projector_pose"] != "per_frame":
        raise InputError(
            "drift is given but the projector pose is not per frame", "drift",
            "use share.projector_pose: per_frame or remove drift",
        )  # fmt: skip
