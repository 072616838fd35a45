"""The values of all unknowns at one moment of the optimisation."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...geometry.laws import ProjectorModel, projector_model
from ...geometry.transforms import RigidTransform

INTRINSICS = {
    "focal": slice(0, 1),
    "centre": slice(1, 3),
    "aspect": slice(3, 4),
    "distortion": slice(4, 9),
}
"""Places in the intrinsics vector (log f, cx, cy, log aspect, k1, k2, p1, p2, k3).

Logarithms keep focal length and aspect positive and make their steps relative.
"""


@dataclass(frozen=True, eq=False)
class State:
    """Current values; lengths are in the problem's working unit."""

    rho: list[NDArray[np.float64]]
    """Inverse ranges (V,) of every surface."""
    world_from_camera: list[RigidTransform]
    """Per frame; the first is the identity."""
    projector_from_camera: list[RigidTransform]
    """Per frame."""
    intrinsics: list[NDArray[np.float64]]
    """Per frame, (9,) as in :data:`INTRINSICS`."""

    def with_(self, **changes: object) -> "State":
        return replace(self, **changes)  # type: ignore[arg-type]


def intrinsics_vector(model: ProjectorModel) -> NDArray[np.float64]:
    """Return the (9,) intrinsics vector of a projector model."""
    coefficients = np.zeros(5)
    coefficients[: len(model.distortion.coefficients)] = model.distortion.coefficients
    return np.concatenate(
        [[np.log(model.focal)], model.centre, [np.log(model.aspect)], coefficients]
    )


def intrinsics_model(law: str, vector: NDArray[np.float64]) -> ProjectorModel:
    """Return the projector model of a (9,) intrinsics vector."""
    k = vector[INTRINSICS["distortion"]]
    used = int(np.max(np.nonzero(k)[0], initial=-1)) + 1
    return projector_model(
        law, float(np.exp(vector[0])), (float(vector[1]), float(vector[2])),
        float(np.exp(vector[3])), [float(c) for c in k[:used]],
    )  # fmt: skip


def shared_focal(sharing: str, state: State) -> float | None:
    """Return the focal length, pattern pixels, or None where every frame has its own."""
    if sharing == "per_frame":
        return None
    return float(np.exp(state.intrinsics[0][INTRINSICS["focal"]][0]))
