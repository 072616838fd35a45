"""The coded grid's decoder on path-traced scenes never trained on, and its time.

Errors are per axis, in grid periods, of the decoded pixels of all images of a kind together; what
counts as lit, and what as heavy corruption, is told in decoder_scenes.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from mitsuba_endo.decoding.grid.decode import decode_image
from mitsuba_endo.decoding.network import Network, load_network

from .decoder_scenes import KINDS, PATTERN, Errors, Kind, Shot, compare, shoot
from .report import Figure, timed

NAME = "decoder"
_figure = partial(Figure, NAME)
WRONG = 0.5
"""Periods of error on an axis from which a pixel is in a wrong period."""


@dataclass(frozen=True)
class Targets:
    """What is to be reached, as the errors' unit says or in %."""

    median: float
    p95: float
    wrong: float
    wrong_far: float | None
    coverage: float


def targets(kind: Kind, heavy: bool) -> Targets:
    folded = kind == "colon"
    if heavy:
        return Targets(0.03, 0.1, 2.0, None, 55.0 if folded else 75.0)
    if folded:
        return Targets(0.012, 0.06, 1.5, 0.5, 85.0)
    return Targets(0.012, 0.06, 0.2, None, 95.0)


def run(quick: bool) -> list[Figure]:
    """Photograph and decode every kind of scene, clean and heavily corrupted."""
    network = load_network()
    figures = []
    for kind in KINDS:
        seeds = range(1, 2 if quick else 6 if kind == "colon" else 4)
        shots = [shoot(kind, seed, spp=8 if quick else 32) for seed in seeds]
        for heavy in (False, True):
            found = [
                judge(network, shot, heavy, seed) for seed, shot in zip(seeds, shots, strict=True)
            ]
            figures += kind_figures(kind, heavy, found)
    return [*figures, _seconds(network, quick)]


def judge(network: Network, shot: Shot, heavy: bool, seed: int) -> Errors:
    """Decode one image of a shot and compare it with the truth."""
    image, visible = shot.image(heavy, seed)
    return compare(decode_image(image, network, PATTERN).q, shot, visible)


def kind_figures(kind: Kind, heavy: bool, found: Sequence[Errors]) -> list[Figure]:
    """Return the figures of the images of one kind."""
    name = f"{kind}, {'heavy' if heavy else 'clean'}, {len(found)} images"
    error = np.concatenate([e.error for e in found])
    far = np.concatenate([e.far for e in found])
    covered = 100 * len(error) / sum(e.lit for e in found)
    aim = targets(kind, heavy)
    figures = [_figure(f"{name}: coverage of lit pixels", covered, "%", "higher", aim.coverage)]
    if not len(error):
        return figures
    wrong = np.asarray((error > WRONG).any(1))
    return [
        *figures,
        _figure(f"{name}: error, median", float(np.median(error)), "periods", "lower", aim.median),
        _figure(f"{name}: error, 95th percentile", float(np.quantile(error, 0.95)), "periods",
                "lower", aim.p95),
        _figure(f"{name}: wrong period", 100 * float(wrong.mean()), "%", "lower", aim.wrong),
        _figure(f"{name}: wrong period, off edges", 100 * float(wrong[far].mean()), "%", "lower",
                aim.wrong_far),
    ]  # fmt: skip


def _seconds(network: Network, quick: bool) -> Figure:
    """Time whole decodes of one 640 x 480 image; the fastest is the least disturbed."""
    shot = shoot("colon", 1, spp=4 if quick else 16, size=(640, 480))
    image = shot.image(False, 1)[0]
    seconds = [timed(lambda: decode_image(image, network, PATTERN))[0] for _ in range(8)]
    return _figure(f"640 x 480 colon, {network.engine}, fastest of 8", min(seconds), "s", "lower",
                   0.5)  # fmt: skip
