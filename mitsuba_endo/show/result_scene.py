"""A result in space, with its truth: what viewer and report show; not how it is drawn."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from ..geometry.transforms import RigidTransform
from ..records.calibration import Calibration, SurfaceEstimate
from . import surface_colours
from .frame_poses import REACH, Floats, FramePoses, Rays, correspondence_rays, frame_poses
from .solution_values import unit_name
from .surface_colours import Shown
from .truth import Truth, load_truth, surface_error

RAYS = 60
"""Correspondences drawn for a frame."""


@dataclass(eq=False)
class ResultScene:
    """A calibration with what is derived from it for looking at."""

    calibration: Calibration
    truth: Truth | None = None
    errors: list[Floats] | None = None
    """Of every surface, from the truth; filled in by :meth:`compare`."""
    _rays: dict[int, Rays | None] = field(default_factory=dict)

    @cached_property
    def poses(self) -> list[FramePoses]:
        return frame_poses(self.calibration.solution)

    @cached_property
    def surfaces(self) -> list[SurfaceEstimate]:
        """One for all frames, or one for each in its camera's frame."""
        own = self.calibration.own_surfaces
        return [self.calibration.surface, *(own[k] for k in sorted(own))]

    @property
    def unit(self) -> str:
        return unit_name(self.calibration.solution)

    @cached_property
    def distance(self) -> float:
        """Median distance of the first surface from its camera."""
        return float(np.median(np.linalg.norm(self.calibration.surface.vertices, axis=-1)))

    @property
    def reach(self) -> float:
        return REACH * self.distance

    def surface_of(self, frame: int) -> int:
        """Return the index of the surface that a frame sees."""
        return frame if len(self.surfaces) > 1 else 0

    def first_from_surface(self, surface: int) -> RigidTransform:
        """Return where a surface lies in the first camera's frame."""
        if len(self.surfaces) == 1:
            return RigidTransform.identity()
        return self.poses[surface].first_from_camera or RigidTransform.identity()

    def quantities(self) -> list[Shown]:
        """Return what the surfaces can be coloured by, the most telling first."""
        out = []
        stds = [s.std for s in self.surfaces]
        if all(std is not None for std in stds):
            out.append(surface_colours.uncertainty([s for s in stds if s is not None], self.unit))
        if self.errors is not None and self.truth is not None:
            out.append(surface_colours.error(self.errors, self.unit, self.truth.alignment))
        out.append(surface_colours.depth([s.vertices for s in self.surfaces], self.unit))
        return out

    def rays(self, frame: int) -> Rays | None:
        """Return a sample of a frame's correspondences, None where its projector is unknown."""
        if frame not in self._rays:
            calibration = self.calibration
            self._rays[frame] = correspondence_rays(
                calibration.solution,
                calibration.camera,
                calibration.frames[frame],
                self.poses[frame],
                RAYS,
            )
        return self._rays[frame]

    def compare(self, path: str | Path) -> None:
        """Load a truth and compare the surfaces with it; starts Mitsuba.

        Raises:
            InputError: as :func:`load_truth`.
        """
        truth = load_truth(path, self.calibration)
        if truth.surface is not None:
            self.errors = [
                surface_error(surface, seen_from(truth, k))
                for k, surface in enumerate(self.surfaces)
            ]
        self.truth = truth


def seen_from(truth: Truth, frame: int) -> SurfaceEstimate:
    """Return the true surface in the true frame of a frame's camera."""
    assert truth.surface is not None
    pose = truth.poses[frame].first_from_camera
    if frame == 0 or pose is None:
        return truth.surface
    return SurfaceEstimate(pose.inverse().apply(truth.surface.vertices), truth.surface.faces)
