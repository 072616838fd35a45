"""When a start counts as right: near the truth, or as near as noise allows."""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform, angle_between
from mitsuba_endo.initialisation.correspondences import gather
from mitsuba_endo.initialisation.epipolar_refinement import evaluate
from mitsuba_endo.initialisation.epipolar_residual import jacobian
from mitsuba_endo.initialisation.result import Start
from mitsuba_endo.initialisation.search import FINISH_POINTS, search_start
from tests.rigs import Rig, random_rig, with_noise, with_outliers

NOISE = 0.3
"""Pattern pixels."""
MOST_OUTLIERS = 0.3


def errors(start: Start, rig: Rig) -> tuple[float, float]:
    """Return the relative focal error and the angle between translation directions, radians."""
    return (
        abs(float(start.projector.focal) / float(rig.projector.focal) - 1),
        angle_between(start.projector_from_camera.t, rig.projector_from_camera.t),
    )


def limits(rig: Rig, inliers: float) -> tuple[float, float]:
    """Cramér-Rao standard deviations of log focal and of t's direction for so many inliers."""
    data = gather(rig.q, np.isfinite(rig.q[..., 0]), rig.camera)
    truth = rig.projector_from_camera
    state = evaluate(RigidTransform(truth.R, truth.t / rig.baseline), rig.projector, data)
    J: NDArray[np.float64] = jacobian(
        state.pose, state.projector, data.rays, data.q, state.bearings, state.at, True
    )
    covariance = np.linalg.inv(J @ J.T * (inliers / len(data))) * NOISE**2
    return float(np.sqrt(covariance[5, 5])), float(np.sqrt(covariance[3, 3] + covariance[4, 4]))


def succeeds(seed: int, camera: CameraModel | None = None) -> bool:
    """Find a random rig with up to 30 % outliers to 1 % and 2 degrees, or to four sigma."""
    rig = random_rig(seed, camera)
    share = np.random.default_rng(1000 + seed).uniform(0, MOST_OUTLIERS)
    noisy = with_outliers(with_noise(rig, NOISE, seed), share, seed)
    try:
        start = search_start(noisy.q, rig.camera, rig.unknown_projector, rig.size)
    except InputError:
        return False
    seen = np.isfinite(rig.q[..., 0]).sum()
    limit_f, limit_t = limits(rig, min(FINISH_POINTS, (1 - share) * seen))
    error_f, error_t = errors(start, rig)
    return error_f < max(0.01, 4 * limit_f) and error_t < max(np.radians(2), 4 * limit_t)
