"""Four photographs of a scene, decoded and calibrated, against true maps with the same noise."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from mitsuba_endo.decoding.grid.decode import decode_image
from mitsuba_endo.decoding.network import Network, load_network
from mitsuba_endo.evaluate.shape import compare_shape
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.calibration import SurfaceEstimate
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Focal, Projector, Rig, Scale
from mitsuba_endo.robust import robust_std
from mitsuba_endo.shapes import Mesh
from mitsuba_endo.solve.calibrate import calibrate

from .decoder_scenes import FOCAL, PATTERN, Kind, Shot, camera, photograph_at, surface
from .report import Figure

NAME = "decoder_end_to_end"
_figure = partial(Figure, NAME)
FRAMES = 4
CORRELATION_PX = 3.5
"""Smoothing of white noise that gives the autocorrelation of the decoder's errors, measured on the
stomach: 0.9 at 2 pixels, 0.7 at 4, 0.4 at 8. Such errors do not average out within a period."""
GUESS = 1.1
"""The focal length's guess over the truth."""


def run(quick: bool) -> list[Figure]:
    """Calibrate a colon and a stomach from images and from maps."""
    network = load_network()
    kinds: tuple[Kind, ...] = ("colon", "stomach")
    return [f for kind in kinds for f in judge(kind, *shoot_frames(kind, 11, quick), network)]


def shoot_frames(kind: Kind, seed: int, quick: bool) -> tuple[Mesh, list[Shot]]:
    """Photograph a surface four times, some mm and degrees apart; the projector moves too."""
    rng = np.random.default_rng((seed, 3))
    mesh = surface(kind, seed)
    lens = camera(rng, *((240, 180) if quick else (480, 360)))
    shots = []
    for k in range(FRAMES):
        at = RigidTransform.of(rng.normal(0, 0.05, 3), rng.normal(0, [2.0, 2.0, 3.0]))
        own = RigidTransform.of(
            np.array([0.03, -0.1, 0.05]) + rng.normal(0, 0.02, 3),
            np.array([-5.8, 1.2, 1.6]) + rng.normal(0, 0.3, 3),
        )
        shots.append(photograph_at(mesh, lens, at, own, 10 * seed + k, 8 if quick else 32))
    return mesh, shots


def judge(kind: Kind, mesh: Mesh, shots: Sequence[Shot], network: Network) -> list[Figure]:
    """Return the errors of the calibration from images, and from maps with the same noise."""
    decoded = [decode_image(shot.image(False, k)[0], network, PATTERN)
               for k, shot in enumerate(shots)]  # fmt: skip
    read = [CorrespondenceMap(d.q, "", d.weight) for d in decoded]
    noise = float(np.median([_noise(m.q, shot) for m, shot in zip(read, shots, strict=True)]))
    white, alike = ([_noisy(shot, noise, spread, seed) for seed, shot in enumerate(shots)]
                    for spread in (0.0, CORRELATION_PX))  # fmt: skip
    focal, shape, frames = calibrated_jointly(mesh, shots, read)
    ideal, matched = (calibrated_jointly(mesh, shots, maps)[1] for maps in (white, alike))
    return [
        _figure(
            f"{kind}: decoder's noise, robust standard deviation", noise, "pattern px", "lower"
        ),
        _figure(f"{kind}: focal error from images", focal, "%", "lower", 0.5),
        _figure(f"{kind}: shape RMSE from images", shape, "mm", "lower"),
        _figure(f"{kind}: shape RMSE from true maps, white noise", ideal, "mm", "lower"),
        _figure(f"{kind}: shape RMSE from true maps, noise like the decoder's", matched, "mm",
                "lower"),
        _figure(f"{kind}: shape RMSE over that of white noise", shape / ideal, "", "lower", 2.0),
        _figure(f"{kind}: shape RMSE over that of noise as the decoder's", shape / matched, "",
                "lower", 2.0),
        _figure(f"{kind}: frames used", frames, f"of {FRAMES}", "higher", FRAMES),
    ]  # fmt: skip


def _noise(q: NDArray[np.float32], shot: Shot) -> float:
    error = (q - shot.q)[np.isfinite(q[..., 0]) & shot.lattice_known]
    return robust_std(error)


def _noisy(shot: Shot, noise: float, spread: float, seed: int) -> CorrespondenceMap:
    """Return true coordinates of the lit pixels with Gaussian noise, smoothed over ``spread``."""
    q = np.where(shot.lattice_known[..., None], shot.q, np.nan)
    rng = np.random.default_rng((seed, 4))
    error = gaussian_filter(rng.standard_normal(q.shape), (spread, spread, 0))
    return CorrespondenceMap((q + noise * error / error.std()).astype(np.float32), "")


def calibrated_jointly(
    mesh: Mesh, shots: Sequence[Shot], maps: Sequence[CorrespondenceMap]
) -> tuple[float, float, int]:
    """Return the focal length's error, %, the shape's RMSE, mm, and the frames used."""
    rig = Rig(
        camera=Camera.from_model(shots[0].camera),
        projector=Projector(
            width=PATTERN.width, height=PATTERN.height, focal=Focal(value=GUESS * FOCAL)
        ),
        scale=Scale(baseline=float(np.linalg.norm(shots[0].projector_from_camera.t))),
    )
    named = [replace(m, name=f"frame {k}") for k, m in enumerate(maps)]
    found = calibrate(named, rig)
    focal = found.solution.projector.focal.value
    error = 100 * abs(focal / FOCAL - 1) if isinstance(focal, float) else np.inf
    camera_from_world = shots[0].world_from_camera.inverse()
    truth = SurfaceEstimate(camera_from_world.apply(mesh.vertices), mesh.faces)
    shape = compare_shape(found.surface, truth, shots[0].camera)
    return error, np.inf if isinstance(shape, str) else shape.rmse, len(found.frames)
