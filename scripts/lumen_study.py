"""Compare the kinds of surface where an endoscope is withdrawn through a closed, folded lumen.

Run from the repository: ``python -m scripts.lumen_study --seeds 1``.
"""

import argparse
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from mitsuba_endo.evaluate.distance import distance_to_mesh
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.records.solution import INTERVAL, PoseEstimate
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.lumen import FOCAL, Lumen, withdrawn

KINDS = ("mesh", "lattice")


def figures(lumen: Lumen, result: Calibration) -> dict[str, float]:
    """Return errors of a calibration and how often its 95 % intervals hold the truth."""
    found, focal = result.surface, result.solution.projector.focal.value
    error = distance_to_mesh(found.vertices, lumen.mesh.vertices, lumen.mesh.faces)
    std = np.ones_like(error) if found.std is None else found.std
    held = error < INTERVAL * std
    in_poses = np.concatenate([*_within(lumen, result)])
    hidden = lumen.completeness(found.vertices, found.faces, lumen.hidden_from_first)
    return {
        "frames used": len(result.solution.frames),
        "surface RMSE, mm": float(np.sqrt(np.mean(error**2))),
        "focal length, error, %": 100 * (focal / FOCAL - 1) if isinstance(focal, float) else np.nan,
        "hidden from the first frame and covered within 1 mm, %": 100 * hidden,
        "intervals of poses that hold the truth, %": 100 * float(in_poses.mean()),
        "intervals of vertices that hold the truth, %": 100 * float(held.mean()),
    }


def _within(lumen: Lumen, result: Calibration) -> Iterator[np.ndarray]:
    """Tell of every unknown component of every pose whether the truth is in its interval."""
    names = [m.name for m in lumen.maps]
    for frame in result.solution.frames:
        k = names.index(frame.name)
        yield _inside(frame.projector_from_camera, lumen.projector_from_camera[k])
        yield _inside(frame.world_from_camera, lumen.world_from_camera[k])


def _inside(estimate: PoseEstimate, true: RigidTransform) -> np.ndarray:
    pose, std = estimate.to_transform(), np.array(estimate.std or [0.0] * 6)
    if pose is None:
        return np.zeros(0, bool)
    turned = Rotation.from_matrix(pose.R @ true.R.T)
    error = np.concatenate([turned.as_rotvec(), pose.t - true.t])
    return (np.abs(error) < INTERVAL * std)[std > 0]


def main() -> None:
    """Parse, calibrate on either surface, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1, help="withdrawals, each with its own noise")
    parser.add_argument("--noise", type=float, default=0.3, help="of a coordinate, pattern pixels")
    parser.add_argument("--surface", choices=KINDS, help="one kind alone")
    given = parser.parse_args()
    for seed in range(given.seeds):
        lumen = withdrawn(seed=seed, noise=given.noise)
        for surface in [given.surface] if given.surface else KINDS:
            with threadpool_limits(1, "blas"):
                result = calibrate(lumen.maps, lumen.rig(), Options(surface=surface))
            print(f"\nseed {seed}, {surface}: {result.solution.outcome}")
            for name, value in figures(lumen, result).items():
                print(f"  {name:56} {value:8.3f}")


if __name__ == "__main__":
    main()
