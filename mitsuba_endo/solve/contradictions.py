"""What of options, rig and frames contradicts the rest or has no effect, told before any work."""

from ..errors import InputError
from ..records.checkpoint import Checkpoint
from ..records.rig import Rig
from .options import Options
from .surfaces.triangle_mesh import TriangleMesh
from .unknowns.layout import Layout

_LATTICE = "leave the surface a lattice"
_DEVIATIONS = {
    "camera.K_std": ("camera_focal", "camera_centre"),
    "camera.distortion_std": ("camera_distortion",),
    "projector.centre_std": ("centre",),
}
"""Which blocks each field of the rig is a prior of."""


def check_surface(options: Options, rig: Rig, frames: int, resume: Checkpoint | None) -> None:
    """Refuse a mesh where nothing would become one.

    Args:
        options: how to solve.
        rig: with the sharing plan.
        frames: number given.
        resume: the earlier calibration to go on with, if any.

    Raises:
        InputError: a mesh of one frame, of frames that share no surface or are not registered, or
            of an earlier calibration on another surface.
    """
    if options.surface != TriangleMesh.kind:
        return
    if resume is not None and any(s.kind != TriangleMesh.kind for s in resume.surfaces):
        raise InputError(
            "the earlier calibration has no mesh", "surface", f"start anew, or {_LATTICE}"
        )
    if frames < 2:
        raise InputError(
            "a mesh is fused from several frames, and one is given", "surface",
            f"give more maps, or {_LATTICE}",
        )  # fmt: skip
    if rig.share.surface != "shared":
        raise InputError(
            "a mesh is one surface for all frames, and the plan asks for one for each", "surface",
            f"use share.surface: shared, or {_LATTICE}",
        )  # fmt: skip
    if options.cameras != "registration":
        raise InputError(
            "a mesh needs frames that are registered", "cameras", "use cameras=registration"
        )


def unused_deviations(rig: Rig, layout: Layout, options: Options) -> list[str]:
    """Return a warning for each field of deviations that nothing used.

    They are priors of unknowns, and with ``check_model`` also what given values may be off by.

    Args:
        rig: as it was given.
        layout: of the unknowns that were solved for.
        options: how.
    """
    if options.check_model:
        return []
    return [
        f"{field}: has no effect, because {' and '.join(f'share.{b}' for b in blocks)} "
        f"{'are' if len(blocks) > 1 else 'is'} fixed; use shared, or leave out --no-check-model"
        for field, blocks in _DEVIATIONS.items()
        if _given(rig, field) and not any(layout.free[b] for b in blocks)
    ]


def _given(rig: Rig, field: str) -> bool:
    part, name = field.split(".")
    return getattr(getattr(rig, part), name) is not None
