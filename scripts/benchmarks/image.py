"""Refinement on the image: errors against those of the decoder's maps, photograph by photograph.

Photographs of five kinds of scenes with seeds that neither training nor tuning saw, each clean,
with speckle of contrast 0.25, and heavily corrupted (decoder_scenes.py). Ratios are refined over
decoded, geometric means over photographs; below 1 is better. The first seeds' maps are calibrated
too, one by one: decoded, refined, and after the second round.

python -m scripts.benchmarks.image SEED... prints the figures of maps of these seeds alone.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.capture.effects import apply_effects
from mitsuba_endo.capture.settings import Effects
from mitsuba_endo.decoding.grid.decode import decode_image
from mitsuba_endo.decoding.network import Network, load_network
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.refine.pattern_image import grid_image
from mitsuba_endo.refine.refine_map import RefinedMap, refine_map

from .decoder_scenes import BRIGHT, KINDS, PATTERN, Kind, Shot, compare
from .image_calibration import Accuracy, Calibrations, all_calibrated
from .image_joint import joint_figures
from .photograph_cache import cached_shot
from .report import Figure, timed

NAME = "image"
_figure = partial(Figure, NAME)
SEEDS = range(801, 809)
CALIBRATED = 4
"""Seeds of each kind whose maps are calibrated: that takes far longer than all else."""
CALIBRATED_COLONS = 8
"""Of colons all are, for the coverage after a second round."""
CONDITIONS = ("clean", "moderate", "heavy")
SMOOTH_PX = 15.0
"""Standard deviation of the Gaussian over which errors are averaged: the smooth error."""
GROSS = 0.3
"""Periods; larger errors are not averaged but counted."""
WRONG = 0.5
SMOOTH_TARGETS = {"clean": 0.4, "moderate": 0.4, "heavy": 0.8}


@dataclass(frozen=True, eq=False)
class Case:
    """One photograph, decoded and refined."""

    kind: Kind
    seed: int
    condition: str
    shot: Shot
    image: NDArray[np.uint8]
    visible: NDArray[np.bool_]
    decoded: CorrespondenceMap
    refined: RefinedMap


def run(quick: bool) -> list[Figure]:
    """Photograph, decode and refine every kind of scene; calibrate some."""
    network, figures = load_network(), []
    seeds = SEEDS[:1] if quick else SEEDS
    for condition in CONDITIONS:
        cases = [case for seed in seeds for case in _cases(network, seed, condition, quick)]
        figures += [*_map_figures(condition, cases), *_calibration_figures(condition, cases)]
    return [*figures, *joint_figures(network, quick), *_seconds(network, quick)]


def _cases(network: Network, seed: int, condition: str, quick: bool) -> Iterator[Case]:
    for kind in KINDS:
        size = (240, 180) if quick else (480, 360)
        shot = cached_shot(kind, seed, spp=8 if quick else 16, size=size)
        yield judge(network, kind, seed, condition, shot)


def judge(network: Network, kind: Kind, seed: int, condition: str, shot: Shot) -> Case:
    """Decode and refine one photograph."""
    image, visible = photograph_of(shot, condition, seed)
    found = decode_image(image, network, PATTERN)
    decoded = CorrespondenceMap(found.q, f"{kind} {seed}", found.weight)
    refined = refine_map(decoded, image, grid_image(PATTERN))
    return Case(kind, seed, condition, shot, image, visible, decoded, refined)


def photograph_of(
    shot: Shot, condition: str, seed: int
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Return a shot's image (H, W, 3) under one condition, and the pixels (H, W) that are lit."""
    image, visible = shot.image(condition == "heavy", seed)
    if condition != "moderate":
        return image, visible
    gain = 0.7 / float(np.percentile(shot.laser.max(-1), BRIGHT))
    effects = Effects(speckle_contrast=0.25, auto_exposure=False, exposure=gain)
    return np.asarray(apply_effects(shot.laser, effects, seed, laser=shot.laser), np.uint8), visible


def smooth_error(q: NDArray[np.floating], shot: Shot) -> float:
    """Return the root mean square, periods, of errors averaged over :data:`SMOOTH_PX`."""
    error = (q - shot.q) / PATTERN.period
    known = np.isfinite(error).all(-1) & (np.abs(np.nan_to_num(error)).max(-1) < GROSS)
    weight = _averaged(known.astype(float))
    seen = weight > GROSS
    parts = [_averaged(np.where(known, error[..., k], 0))[seen] / weight[seen] for k in (0, 1)]
    return float(np.sqrt(np.mean(np.square(parts))))


def _averaged(field: NDArray[np.float64]) -> NDArray[np.float64]:
    border = cv2.BORDER_CONSTANT
    return np.asarray(cv2.GaussianBlur(field, (0, 0), SMOOTH_PX, borderType=border), np.float64)


def normalised(case: Case) -> NDArray[np.float64]:
    """Return errors over their stated standard deviations (K, 2) where none is gross."""
    map_ = case.refined.map
    error = map_.q - case.shot.q
    small = np.abs(np.nan_to_num(error, nan=np.inf)).max(-1) < GROSS * PATTERN.period
    used = small & case.visible
    assert map_.covariance is not None
    return error[used] / np.sqrt(map_.covariance[used][:, [0, 2]])


def _map_figures(condition: str, cases: Sequence[Case]) -> Iterator[Figure]:
    """Yield the figures that need no calibration."""
    name = f"{condition}, {len(cases)} photographs"
    ratios = np.array([_smooth_ratio(c) for c in cases])
    yield _figure(f"{name}: smooth error", _mean(ratios), "of the decoder's", "lower",
                  SMOOTH_TARGETS[condition])  # fmt: skip
    yield _figure(f"{name}: smooth error, worst", float(ratios.max()), "of the decoder's", "lower",
                  1.2 if condition == "heavy" else 1.3)  # fmt: skip
    plain, better = ([_rms(q, c) for q, c in ((m(c), c) for c in cases)]
                     for m in (lambda c: c.decoded.q, lambda c: c.refined.map.q))  # fmt: skip
    yield _figure(f"{name}: error of single pixels", _mean(np.divide(better, plain)),
                  "of the decoder's", "lower")  # fmt: skip
    for kind in KINDS:
        of_kind = [c for c in cases if c.kind == kind]
        z = np.concatenate([normalised(c) for c in of_kind if not c.refined.reason])
        yield _figure(f"{name}: normalised errors of a {kind}", float(np.sqrt(np.mean(z**2))),
                      "RMS, 0.8 to 1.3", "")  # fmt: skip
        if kind == "colon":
            yield from _coverage(f"{condition} {kind}", of_kind)


def _smooth_ratio(case: Case) -> float:
    """Return the smooth error after over that before, over pixels that both maps have."""
    before, after = case.decoded, case.refined.map
    both = (before.valid & after.valid)[..., None]
    q = (np.where(both, map_.q, np.nan) for map_ in (after, before))
    return smooth_error(next(q), case.shot) / smooth_error(next(q), case.shot)


def _coverage(name: str, cases: Sequence[Case]) -> Iterator[Figure]:
    for which, maps in (("decoded", [c.decoded for c in cases]),
                        ("refined", [c.refined.map for c in cases])):  # fmt: skip
        found = [compare(m.q, c.shot, c.visible) for m, c in zip(maps, cases, strict=True)]
        error = np.concatenate([e.error for e in found])
        covered = 100 * len(error) / sum(e.lit for e in found)
        wrong = 100 * float(np.mean((error > WRONG).any(1)))
        yield _figure(f"{name}, {which}: coverage of lit pixels", covered, "%", "higher")
        yield _figure(f"{name}, {which}: wrong period", wrong, "%", "lower")


def _rms(q: NDArray[np.floating], case: Case) -> float:
    error = compare(q, case.shot, case.visible).error
    return float(np.sqrt(np.mean(error[(error < GROSS).all(1)] ** 2)))


def calibrations_of(case: Case) -> Calibrations:
    """Calibrate from a photograph's maps, once."""
    size = f"{case.shot.camera.width}x{case.shot.camera.height}"
    name = f"{case.kind}_{case.seed}_{case.condition}_{size}"
    return all_calibrated(name, case.kind, case.seed, case.shot, case.visible, case.image,
                          case.decoded, case.refined.map)  # fmt: skip


def chosen(case: Case) -> bool:
    """Tell whether a photograph is calibrated."""
    count = CALIBRATED_COLONS if case.kind == "colon" else CALIBRATED
    return case.seed - SEEDS[0] < count


def _calibration_figures(condition: str, cases: Sequence[Case]) -> Iterator[Figure]:
    found = {(c.kind, c.seed): calibrations_of(c) for c in cases if chosen(c)}
    judged = [f for (_, seed), f in found.items() if seed - SEEDS[0] < CALIBRATED]
    limit, worst = (0.8, 1.2) if condition == "heavy" else (0.35, 1.3)
    name = f"{condition}, {len(judged)} calibrations"
    for what in Accuracy.__dataclass_fields__:
        plain, *better = (np.array([getattr(getattr(f, which), what) for f in judged])
                          for which in ("decoded", "refined", "second"))  # fmt: skip
        aim = limit if what != "range_mm" or condition == "heavy" else 0.5
        yield _figure(f"{name}: {what}, decoded, median", float(np.nanmedian(plain)), "", "lower")
        for which, value in zip(("refined", "second round"), better, strict=True):
            ratio = value / plain
            yield _figure(
                f"{name}: {what}, {which}, median", float(np.nanmedian(value)), "", "lower"
            )
            yield _figure(f"{name}: {what}, {which}", _mean(ratio), "of the decoder's", "lower",
                          aim)  # fmt: skip
            yield _figure(f"{name}: {what}, {which}, worst", float(np.nanmax(ratio)),
                          "of the decoder's", "lower", worst)  # fmt: skip
    yield from _second_coverage(condition, [f for (kind, _), f in found.items() if kind == "colon"])


def _second_coverage(condition: str, colons: Sequence[Calibrations]) -> Iterator[Figure]:
    lit, read, wrong = (sum(getattr(f, k) for f in colons) for k in ("lit", "read", "wrong"))
    name, heavy = f"{condition} colon, second round", condition == "heavy"
    yield _figure(f"{name}: coverage of lit pixels", 100 * read / lit, "%", "higher",
                  75 if heavy else None)  # fmt: skip
    yield _figure(f"{name}: wrong period", 100 * wrong / read, "%", "lower", 1 if heavy else None)


def _mean(ratios: NDArray[np.float64]) -> float:
    """Return the geometric mean, without photographs of which one map leaves the value open."""
    return float(np.exp(np.nanmean(np.log(ratios))))


def _seconds(network: Network, quick: bool) -> Iterator[Figure]:
    """Time refinements of one 640 x 480 colon, which has folds; the fastest is least disturbed."""
    shot = cached_shot("colon", SEEDS[0], spp=4 if quick else 16, size=(640, 480))
    case = judge(network, "colon", SEEDS[0], "clean", shot)
    image, _ = photograph_of(shot, "clean", SEEDS[0])
    run_once = partial(refine_map, case.decoded, image, grid_image(PATTERN))
    seconds = [timed(run_once)[0] for _ in range(3 if quick else 8)]
    yield _figure("640 x 480 colon, fastest of 8", min(seconds), "s", "lower", 0.3)


if __name__ == "__main__":
    decoder = load_network()
    given = [int(text) for text in sys.argv[1:]]
    for kind_of_light in CONDITIONS:
        judged = [c for seed in given for c in _cases(decoder, seed, kind_of_light, quick=False)]
        for figure in _map_figures(kind_of_light, judged):
            print(figure, flush=True)
