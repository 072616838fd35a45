"""The prototype's scene: calibration against pycolmap's bundle adjustment, same correspondences."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.evaluate.depth import RayCaster, range_image
from mitsuba_endo.geometry.transforms import rotation_angle
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options

from .pycolmap_bundle import Adjusted, adjust
from .report import Figure, timed
from .scene import PLANE_MM, TRUE_FOCAL, Scene, make_scene

NAME = "bundle"
_figure = partial(Figure, NAME)


@dataclass(frozen=True, eq=False)
class Round:
    """One repetition: ours in three ways and the peer, one after the other."""

    search: tuple[float, Calibration]
    """Seconds and result, everything included."""
    lean: tuple[float, Calibration]
    """Without the jackknife, which the peer has no counterpart of."""
    plane: tuple[float, Calibration]
    """From the start that the peer gets."""
    peer: Adjusted


def run(quick: bool) -> list[Figure]:
    """Measure both on the prototype's scene in turn, and compare both with the truth."""
    scene = make_scene(120, 120) if quick else make_scene()
    options = Options(plane_distance=PLANE_MM / scene.baseline)
    variants = [options, replace(options, jackknife=False), replace(options, start="plane")]

    def measure() -> Round:
        search, lean, plane = (
            timed(lambda o=o: calibrate([scene.map], scene.rig, o)) for o in variants
        )
        return Round(search, lean, plane, adjust(scene))

    measure()  # compiles the kernels
    rounds = [measure() for _ in range(2 if quick else 5)]
    return [*_accuracy(scene, rounds[-1]), *_times(rounds)]


def _accuracy(scene: Scene, last: Round) -> list[Figure]:
    """Compare with the truth; the peer's gross outliers, which run off to infinity, are spared."""
    found, peer = last.search[1], last.peer
    ours = shape_rmse(scene, found)
    theirs = _rms(point_errors(scene, peer)[~scene.gross[scene.map.valid]])
    pose = found.solution.frames[0].projector_from_camera.to_transform()
    assert pose is not None
    turned = np.degrees(rotation_angle(pose.R @ scene.true_pose.R.T))
    return [
        _figure("focal error", _focal_error(_focal(found)), "%", "lower", 0.1),
        _figure("focal error, plane start", _focal_error(_focal(last.plane[1])), "%", "lower", 0.1),
        _figure("focal error, pycolmap", _focal_error(peer.focal), "%", "lower"),
        _figure("rotation error", float(turned), "deg", "lower"),
        _figure("shape RMSE along the rays of all pixels", ours, "mm", "lower", 0.15),
        _figure("point RMSE without gross outliers, pycolmap", theirs, "mm", "lower"),
        _figure("pycolmap's point RMSE / our shape RMSE", theirs / ours, "ratio", "higher", 4),
    ]


def _times(rounds: list[Round]) -> list[Figure]:
    def median(value: Callable[[Round], float]) -> float:
        return float(np.median([value(r) for r in rounds]))

    def solve(measured: tuple[float, Calibration]) -> float:
        return measured[0] - measured[1].solution.timings["start"]

    def against(value: Callable[[Round], float]) -> float:
        return median(lambda r: value(r) / r.peer.seconds)

    return [
        _figure("time without the start / pycolmap's", against(lambda r: solve(r.search)),
                "ratio", "lower", 0.25),
        _figure("the same without the jackknife", against(lambda r: solve(r.lean)),
                "ratio", "lower", 0.25),
        _figure("time from the plane start / pycolmap's", against(lambda r: r.plane[0]),
                "ratio", "lower", 0.25),
        _figure("time with the start / pycolmap's", against(lambda r: r.search[0]),
                "ratio", "lower", 0.5),
        _figure("time with the start", median(lambda r: r.search[0]), "s", "lower"),
        _figure("time, pycolmap", median(lambda r: r.peer.seconds), "s", "lower"),
    ]  # fmt: skip


def shape_rmse(scene: Scene, found: Calibration) -> float:
    """Return the RMS difference of the ranges along the pixels' rays, mm."""
    caster = RayCaster(found.surface.vertices, found.surface.faces)
    difference = range_image(caster, scene.camera) - scene.true_range
    seen = np.isfinite(difference)
    if seen.mean() < 0.99:
        raise RuntimeError(f"only {100 * seen.mean():.1f} % of the pixels meet the surface")
    return _rms(difference[seen])


def point_errors(scene: Scene, peer: Adjusted) -> NDArray[np.float64]:
    """Return the distances (N,) of the peer's points from the truth, mm."""
    valid = scene.map.valid
    rays = scene.camera.grid_rays[valid]
    return np.linalg.norm(peer.points - rays * scene.true_range[valid][:, None], axis=1)


def _focal(found: Calibration) -> float:
    value = found.solution.projector.focal.value
    assert isinstance(value, float)
    return value


def _focal_error(focal: float) -> float:
    return 100 * abs(focal / TRUE_FOCAL - 1)


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))
