"""A fit's frames without their surfaces: epipolar residuals of a sample, with derivatives.

A surface that is free takes one of the two components of every correspondence; the epipolar
residual is the other, and hangs on a few unknowns alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....geometry.cameras import CameraModel
from ....geometry.projection_models import ProjectorModel
from ....geometry.transforms import RigidTransform
from ....initialisation.epipolar_residual import (
    Bearings,
    Residuals,
    bearings,
    pose_jacobian,
    residuals,
)
from ...costs.coordinate_residual import Observations
from ...costs.objective import Problem
from ...unknowns.block import BLOCKS, PoseBlock
from ...unknowns.layout import Layout
from ...unknowns.state import State

Floats = NDArray[np.float64]

_STEP = 1e-6
"""Of the differences, in the components' own units."""


@dataclass(frozen=True, eq=False)
class EpipolarFrame:
    """One frame's sample at a state."""

    law: str
    camera: object
    """What the rays hang on, and the bearings, to be compared."""
    projector: object
    pose: RigidTransform
    rays: Floats
    """(3, n) directions of any length in the camera's frame."""
    bearings: Bearings
    at: Residuals
    root: Floats | float
    """(n,) square root of the weights."""

    @property
    def r(self) -> Floats:
        """(n,) weighted residuals, pattern pixels, NaN where there is none."""
        return self.at.r * self.root


def possible(problem: Problem, state: State) -> bool:
    """Tell whether all frames have plain projectors, which can be inverted."""
    return all(problem.projector(state, k) is not None for k in range(problem.layout.frames))


def thinned(observed: Observations, stride: int) -> Observations:
    """Return the observations at every ``stride``-th row and column."""
    kept = (observed.pixels % stride == 0).all(1)
    W = observed.whitening
    return replace(
        observed, q=observed.q[:, kept], pixels=observed.pixels[kept],
        whitening=None if W is None else W[..., kept],
    )  # fmt: skip


def epipolar_frame(
    observed: Observations, law: str, state: State, k: int, last: EpipolarFrame | None = None
) -> EpipolarFrame:
    """Return a frame's residuals; what has not changed since ``last`` is taken from there."""
    model = state.frame_model(k, observed.camera, law)
    assert isinstance(model.projector, ProjectorModel)  # see `possible`
    camera, projector = _camera(model.camera), _projector(model.projector)
    with np.errstate(all="ignore"):
        if last is not None and camera == last.camera:
            rays = last.rays
        else:
            rays = np.stack(model.camera.direction_uv(*observed.pixels.T.astype(np.float64)))
        if last is not None and projector == last.projector:
            pattern_bearings = last.bearings
        else:
            near = None if last is None or law != last.law else last.bearings
            pattern_bearings = bearings(model.projector, observed.q, near)
        pose = state.at("projector_pose", k)
        at = residuals(pose, rays, pattern_bearings)
    return EpipolarFrame(
        law, camera, projector, pose, rays, pattern_bearings, at, _root_weight(observed)
    )


def derivatives(
    observed: Observations, law: str, state: State, layout: Layout, k: int, now: EpipolarFrame
) -> Floats:
    """Return the derivatives (G, n) of a frame's residuals with respect to a layout's unknowns.

    Those of camera poses are zero: without a surface nothing ties frames together.
    """
    out = np.zeros((layout.columns, len(now.r)))
    for name in layout.active(k):
        owner = layout.owner(name, k)
        slot, T = layout.slots[name, owner], layout.tangent_map(state, name, owner)
        if name == "projector_pose":
            out[slot] = T.T @ pose_jacobian(now.pose, now.bearings, now.at) * now.root
        elif not isinstance(BLOCKS[name], PoseBlock):
            moved = [along(observed, law, state, k, now, name, step) for step in T.T]
            out[slot] = np.array(moved)
    return out


def along(
    observed: Observations,
    law: str,
    state: State,
    k: int,
    now: EpipolarFrame,
    name: str,
    step: Floats,
) -> Floats:
    """Return the derivative (n,) of a frame's residuals along a step of one block's value."""
    owner, size = state.owners[name][k], _STEP / float(np.linalg.norm(step))
    value = BLOCKS[name].retract(state.values[name][owner], size * step)
    moved = epipolar_frame(observed, law, state.with_value(name, owner, value), k, now)
    return (moved.r - now.r) / size


def _camera(camera: CameraModel) -> object:
    return np.asarray(camera.K, float).tolist(), [float(c) for c in camera.distortion]


def _projector(p: ProjectorModel) -> object:
    coefficients = [float(c) for c in p.distortion.coefficients]
    return p.law, float(p.focal), [float(c) for c in p.centre], float(p.aspect), coefficients


def _root_weight(observed: Observations) -> Floats | float:
    W = observed.whitening
    if W is None:
        return 1.0
    return W if W.ndim == 1 else np.sqrt(np.abs(np.linalg.det(np.moveaxis(W, -1, 0))))
