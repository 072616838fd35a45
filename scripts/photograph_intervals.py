"""How often stated 95 % intervals hold the truth on photographs, decoded, refined, calibrated.

Run from the repository: ``python -m scripts.photograph_intervals``. Each seed
is a photograph of every kind of scene but the small rabbit, clean, with speckle and heavily spoilt.
"""

import argparse
from typing import get_args

import numpy as np
from scipy.spatial.transform import Rotation

from mitsuba_endo import backend
from mitsuba_endo.decoding.network import load_network
from mitsuba_endo.errors import InputError
from mitsuba_endo.records.rig import Camera, Projector, Rig, Scale
from mitsuba_endo.records.solution import INTERVAL, Solution
from mitsuba_endo.solve.calibrate import calibrate
from scripts.benchmarks.decoder_scenes import FOCAL, PATTERN, Kind, Shot
from scripts.benchmarks.image import CONDITIONS, judge
from scripts.benchmarks.photograph_cache import cached_shot

SIZE = (320, 240)
KINDS = tuple(kind for kind in get_args(Kind) if kind != "rabbit")


def _rig(shot: Shot) -> Rig:
    return Rig(
        camera=Camera.from_model(shot.camera),
        projector=Projector(width=PATTERN.width, height=PATTERN.height),
        scale=Scale(baseline=float(np.linalg.norm(shot.projector_from_camera.t))),
    )


def _deviations(solution: Solution, shot: Shot) -> tuple[float, np.ndarray] | None:
    """Return the errors of focal length and pose in stated deviations; None: not determined."""
    focal, found = solution.projector.focal, solution.frames[0].projector_from_camera
    pose, truth = found.to_transform(), shot.projector_from_camera
    if not (isinstance(focal.value, float) and isinstance(focal.std, float)) or pose is None:
        return None
    turn = Rotation.from_matrix(truth.R @ pose.R.T).as_rotvec()
    off = np.concatenate([turn, truth.t - pose.t]) / np.array(found.std)
    return (focal.value - FOCAL) / focal.std, off


def main() -> None:
    """Parse, photograph, calibrate, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=9300)
    arguments = parser.parse_args()
    backend.use()
    network, focals, poses = load_network(None), [], []
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        for kind in KINDS:
            shot = cached_shot(kind, seed, spp=16, size=SIZE)
            for condition in CONDITIONS:
                try:
                    map_ = judge(network, kind, seed, condition, shot).refined.map
                except InputError:
                    print(f"{kind} {seed} {condition}: not decoded", flush=True)
                    continue
                off = _deviations(calibrate([map_], _rig(shot)).solution, shot)
                if off is None:
                    print(f"{kind} {seed} {condition}: not determined", flush=True)
                    continue
                focals.append(abs(off[0]) < INTERVAL)
                poses.extend(np.abs(off[1]) < INTERVAL)
                worst = np.abs(off[1]).max()
                print(f"{kind} {seed} {condition}: {off[0]:.1f}, {worst:.1f}", flush=True)
    print(f"held: focal length {sum(focals)} of {len(focals)}, pose {sum(poses)} of {len(poses)}")


if __name__ == "__main__":
    main()
