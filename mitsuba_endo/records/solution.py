"""The result of a calibration, and the truth of a synthetic one: the same structure."""

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from ..files import atomic_path
from ..geometry.projection_models import ProjectorModel, projector_model
from ..geometry.transforms import RigidTransform
from ..reading.trees import read_json
from .rig import Camera
from .validation import Record, validate

Matrix3 = Annotated[
    list[Annotated[list[float], Field(min_length=3, max_length=3)]],
    Field(min_length=3, max_length=3),
]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
INTERVAL = 1.96
"""Standard deviations on each side of a 95 % interval."""
SCHEMA = 1
"""Version of solution.json; there has been no other."""


class Outcome(StrEnum):
    """How a calibration ended."""

    CONVERGED = "converged"
    """The parameters stopped changing."""
    MAX_ITERATIONS = "max_iterations"
    """Stopped by the limit on iterations: the values may still move."""
    STALLED = "stalled"
    """No step lowers the cost and the parameters had not settled."""
    INTERRUPTED = "interrupted"
    """Stopped by the user; the values are those of the last iteration."""
    TRUTH = "truth"
    """Not a calibration but the exact values of a synthetic scene."""


Status = Literal["measured", "weak", "unobservable", "fixed"]


class Estimate(Record):
    """A number or vector with its standard deviation; null when it could not be determined."""

    value: float | list[float] | None
    std: float | list[float] | None = None
    """The larger of the formal one times the root of the residuals' design effect, and the
    block-jackknife one; same unit."""
    std_formal: float | list[float] | None = None
    """From the Hessian at the solution: right if the model is."""
    std_jackknife: float | list[float] | None = None
    """From leaving out image blocks or frames: sees errors of the model too."""
    status: Status
    reason: str | None = None
    """Why the value is weak or null, and what would help."""


class PoseEstimate(Record):
    """X_to = R X_from + t."""

    R: Matrix3 | None
    t: Vector3 | None
    std: list[float] | None = None
    """Six values: rotation vector (radians), translation (the solution's unit)."""
    std_formal: list[float] | None = None
    std_jackknife: list[float] | None = None
    covariance: Annotated[list[Six], Field(min_length=6, max_length=6)] | None = None
    """(6, 6), of which ``std`` is the diagonal's root; None where the pose is no unknown."""
    status: Status = "measured"
    reason: str | None = None

    @classmethod
    def of(cls, pose: RigidTransform, **fields: Any) -> "PoseEstimate":
        return cls(R=pose.R.tolist(), t=pose.t.tolist(), **fields)

    def to_transform(self) -> RigidTransform | None:
        """Return the transform, or None where it could not be determined."""
        return None if self.R is None or self.t is None else RigidTransform.of(self.R, self.t)

    def length_std(self) -> float | None:
        """Return the standard deviation of the translation's length, None where it is unknown.

        With u = t / |t| it is sqrt(u' C u), C being the translation's covariance; of files without
        covariances the most that their deviations allow, sum |u_i| s_i.
        """
        if self.t is None or self.std is None or not any(self.t):
            return None
        u = np.array(self.t) / np.linalg.norm(self.t)
        if self.covariance is None:
            return float(np.abs(u) @ np.array(self.std[3:]))
        return float(np.sqrt(max(u @ np.array(self.covariance)[3:, 3:] @ u, 0.0)))


class ProjectorEstimate(Record):
    """Projector intrinsics."""

    law: str
    width: int | None = None
    height: int | None = None
    focal: Estimate
    centre: Estimate
    aspect: Estimate = Estimate(value=1.0, status="fixed")
    distortion: Estimate = Estimate(value=[], status="fixed")

    def to_model(self) -> ProjectorModel | None:
        """Return the model, or None where a value could not be determined."""
        values = [e.value for e in (self.focal, self.centre, self.aspect, self.distortion)]
        if any(v is None for v in values):
            return None
        focal, centre, aspect, distortion = (np.asarray(v, float) for v in values)
        return projector_model(
            self.law, float(focal), [float(c) for c in centre], float(aspect),
            [float(k) for k in distortion],
        )  # fmt: skip


class Frame(Record):
    """One captured frame."""

    name: str
    projector_from_camera: PoseEstimate
    world_from_camera: PoseEstimate
    focal: Estimate | None = None
    """Only where the focal length is per frame."""
    rms_px: float | None = None
    """Robust RMS of the residuals of the pixels used, pattern pixels."""
    used: int | None = None
    """Number of correspondences used."""
    median_px: float | None = None
    outliers: float | None = None
    """Share of correspondences that the robust loss switched off."""
    slips: int | None = None
    """Correspondences found to be off by whole pattern periods."""


class Alternative(Record):
    """Another projector pose that explains the correspondences of some frames about as well."""

    frames: list[str]
    """Names of the frames that have this pose."""
    R: Matrix3
    t: Vector3
    """Projector from camera, the baseline taken to be as long as the solution's."""
    focal: float
    """Pattern pixels."""
    cost_ratio: float
    """Robust cost of the epipolar residuals over that of the solution; below 1 it fits better."""
    decided: bool
    """Whether the residuals prefer the solution by more than noise can make."""
    reason: str
    """What it is and what would rule it out, in words."""

    def to_transform(self) -> RigidTransform:
        """Return the pose."""
        return RigidTransform.of(self.R, self.t)


class LeftOut(Record):
    """A frame that is not part of the solution."""

    name: str
    reason: str


class Solution(Record):
    """Contents of ``solution.json`` and ``truth.json``."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True
    )

    schema_version: Literal[1] = Field(default=SCHEMA, alias="schema")
    outcome: Outcome
    units: Literal["mm", "baseline"]
    """``baseline`` when the scale is unknown: lengths are multiples of the first baseline."""
    scale: Literal["baseline", "known_distance", "up_to_scale", "truth"]
    scale_std_percent: float = 0.0
    """Standard deviation of the unit of length, which every metric value shares."""
    verdict: list[str] = []
    """What was measured and what was not, in words."""
    warnings: list[str] = []
    camera: Camera | None = None
    projector: ProjectorEstimate
    blocks: dict[str, Estimate] = {}
    """Further unknowns that were estimated, by the name of their block in the rig's ``share``."""
    frames: list[Frame] = Field(min_length=1)
    left_out: list[LeftOut] = []
    alternatives: list[Alternative] = []
    """Poses that the data hardly tell from the solution's: the planar twin, above all."""
    surface: str | None = None
    """File name of the surface beside this file, in the first camera's frame."""
    noise_px: float | None = None
    """Robust estimate of the noise of one projector coordinate, pattern pixels; where maps have
    weights, of a coordinate of their mean weight."""
    law_evidence: dict[str, Any] = {}
    model: dict[str, Any] = {}
    """Structure of the residuals, what may cause it, and what it does to the intervals."""
    observability: dict[str, Any] = {}
    timings: dict[str, float] = {}
    versions: dict[str, str] = {}
    configuration: dict[str, Any] = {}

    def _repr_html_(self) -> str:
        """Show verdict and values where a notebook asks for them."""
        # Notebooks look for the method here. The only look up the house, and not before asked.
        from ..show.notebook import solution_html

        return solution_html(self)


def save_solution(path: str | Path, solution: Solution) -> None:
    """Write a solution or truth file."""
    text = solution.model_dump_json(by_alias=True, indent=1)
    with atomic_path(path) as aside:
        aside.write_text(text + "\n", encoding="utf-8")


def solution_file(path: str | Path) -> Path:
    """Return the solution or truth file that a folder stands for; another path as it is."""
    path = Path(path)
    if not os.path.isdir(path):  # which takes names of any length
        return path
    name, other = "solution.json", "truth.json"
    only_other = (path / other).exists() and not (path / name).exists()
    return path / (other if only_other else name)


def load_solution(path: str | Path) -> Solution:
    """Read a solution or truth file, or the one in a solution folder.

    Raises:
        InputError: names the file and field.
    """
    path = solution_file(path)
    from .solution_checks import check_solution  # it knows this module

    return check_solution(validate(Solution, read_json(path), str(path)), str(path))
