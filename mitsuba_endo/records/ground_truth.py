"""What is exactly true of a synthetic capture, before any file."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..geometry.endoscope import Endoscope
from .rig import Camera
from .solution import (
    Estimate,
    Frame,
    Outcome,
    PoseEstimate,
    ProjectorEstimate,
    Solution,
    save_solution,
)


@dataclass(frozen=True, eq=False)
class TrueFrame:
    """One frame of a synthetic capture."""

    name: str
    endoscope: Endoscope
    """Camera and projector where they stood, mm."""


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """The exact calibration of a synthetic scene, whose intrinsics all frames share.

    Nothing in it is an estimate: it has no deviations, statuses or verdict, and no null.
    """

    frames: Sequence[TrueFrame]
    pattern_size: tuple[int, int]
    """Width and height, pattern pixels."""
    surface: str | None = None
    """File of the true surface beside ``truth.json``, in the first camera's frame."""
    configuration: dict[str, Any] = field(default_factory=dict)
    """With which the scene was made."""

    @property
    def first(self) -> Endoscope:
        """Camera and projector of the first frame."""
        return self.frames[0].endoscope

    def to_solution(self) -> Solution:
        """Return it in the schema of ``solution.json``, which ``truth.json`` shares.

        So any calibration may stand for the truth of another, and every reader of one reads both.
        """
        projector, (width, height) = self.first.projector, self.pattern_size
        return Solution(
            outcome=Outcome.TRUTH,
            units="mm",
            scale="truth",
            camera=Camera.from_model(self.first.camera),
            projector=ProjectorEstimate(
                law=projector.law,
                width=width,
                height=height,
                focal=_exact(float(projector.focal)),
                centre=_exact([float(c) for c in projector.centre]),
                aspect=_exact(float(projector.aspect)),
                distortion=_exact([float(k) for k in projector.distortion.coefficients]),
            ),
            frames=[_frame(frame) for frame in self.frames],
            surface=self.surface,
            configuration=self.configuration,
        )


def save_truth(path: str | Path, truth: GroundTruth) -> None:
    """Write ``truth.json``.

    Raises:
        InputError: the file cannot be written.
    """
    save_solution(path, truth.to_solution())


def _frame(frame: TrueFrame) -> Frame:
    at = frame.endoscope
    return Frame(
        name=frame.name,
        projector_from_camera=PoseEstimate.of(at.projector_from_camera, status="fixed"),
        world_from_camera=PoseEstimate.of(at.world_from_camera, status="fixed"),
    )


def _exact(value: float | list[float]) -> Estimate:
    return Estimate(value=value, status="fixed")
