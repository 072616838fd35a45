"""Search for the motion and relative scale between two range images, without a guess."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from .icp import Source, align, cost, match, sample
from .range_image import Level, RangeImage, make_level, mean_range
from .similarity import Similarities

Floats = NDArray[np.float64]

STARTS = 512
TURN = np.radians(18)
SHIFT = 0.42


@dataclass(frozen=True, eq=False)
class Frame:
    image: RangeImage

    @cached_property
    def unit(self) -> float:
        return mean_range(self.image)

    def _level(self, columns):
        return make_level(self.image, max(1, round(self.image.range.shape[1] / columns)))

    @cached_property
    def coarse(self) -> Level:
        return self._level(54)

    @cached_property
    def fine(self) -> Level:
        return self._level(110)


def starts(seed):
    cube = qmc.Sobol(6, rng=seed).random(STARTS)
    return Similarities.of(TURN * _ball(cube[:, :3]), SHIFT * _ball(cube[:, 3:]))


def _ball(c):
    radius = np.cbrt(c[:, :1])
    z = 2 * c[:, 1:2] - 1
    around = 2 * np.pi * c[:, 2:]
    flat = np.sqrt(1 - z * z)
    return radius * np.concatenate([flat * np.cos(around), flat * np.sin(around), z], 1)


STAGES = ((0.05, 5, 200, 48), (0.03, 5, 400, 10), (0.02, 6, 1000, 4))


def best(poses, source, target, scale, keep):
    c, overlap = cost(match(poses, source, target, scale), scale)
    score = c / np.maximum(overlap, 1e-3)
    order = np.argsort(score)
    kept = []
    for i in order:
        if len(kept) == keep:
            break
        if kept:
            k = poses[np.array(kept)]
            j = poses[np.full(len(kept), i)]
            d = np.maximum(j.angle_to(k) / 0.04, np.linalg.norm(j.t - k.t, axis=1) / 0.04)
            if d.min() < 1:
                continue
        kept.append(int(i))
    kept = np.array(kept)
    return poses[kept], score[kept], c[kept], overlap[kept]


def search(target: Frame, source: Frame, rng):
    pose = starts(rng)
    for scale, steps, count, keep in STAGES:
        cloud = sample(source.coarse, count, rng)
        pose = align(pose, cloud, target.coarse, scale, steps)
        pose, score, c, ov = best(pose, cloud, target.coarse, scale, keep)
    cloud = sample(source.fine, 2500, rng)
    for scale in (0.015, 0.01):
        pose = align(pose, cloud, target.fine, scale, 6)
    return best(pose, cloud, target.fine, 0.01, 4)
