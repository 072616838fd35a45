"""Errors of a grid decoder: wavering lines, slips by a period, missing patches, mixed silhouettes.

Sizes follow what a decoder of a 32 x 32 grid shows under heavy corruption: a median error of 0.015
periods an axis, 1 to 2 % of the pixels off by whole periods, mostly beside depth steps, and patches
without a reading where light is missing or too strong.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, map_coordinates, maximum_filter

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

_JUMP = 3.0
"""Neighbours that differ by this many times the usual difference lie on two sides of a step."""


@dataclass(frozen=True)
class DecoderNoise:
    """How much of each error."""

    period: float = 16.0
    """Of the grid, pattern pixels."""
    line: float = 0.018
    """Standard deviation of where a line is found, periods; it changes only slowly along the line,
    so neighbouring pixels err alike."""
    along: float = 0.5
    """Width (one standard deviation) of the filter that makes it slow, periods."""
    white: float = 0.012
    """Standard deviation of the error that every pixel has of its own, periods."""
    slips: float = 0.015
    """Share of the readings in patches that are off by one period along one axis."""
    missing: float = 0.08
    """Share of the image in patches without a reading."""
    outliers: float = 0.005
    """Share of single readings that are anywhere in the pattern."""

    def apply(self, q: Floats, size: tuple[int, int], rng: np.random.Generator) -> Floats:
        """Return exact coordinates q (H, W, 2), pattern pixels, as a decoder would read them."""
        steps = beside_steps(q)
        wavering = self.period * self.line * self._wavering(q, size, rng)
        read = q + wavering + self.period * self.white * rng.standard_normal(q.shape)
        read = _mixed(read, steps, rng)
        read = self._slipped(read, steps, rng)
        gross = np.isfinite(q).all(-1) & (rng.random(q.shape[:2]) < self.outliers)
        read[gross] = rng.uniform(-0.5, np.array(size) - 0.5, (int(gross.sum()), 2))
        read[_patches(np.ones(q.shape[:2], bool), self.missing, (0.02, 0.08), rng)] = np.nan
        return read

    def _wavering(self, q: Floats, size: tuple[int, int], rng: np.random.Generator) -> Floats:
        """Return a field (H, W, 2) of unit variance at the lines, smooth along each of them."""
        out = np.full(q.shape, np.nan)
        for axis in (0, 1):
            lines, along = int(size[axis] / self.period) + 2, int(size[1 - axis]) + 1
            field = gaussian_filter1d(
                rng.standard_normal((lines, along)), self.along * self.period, axis=1
            )
            field /= field.std()
            at = [q[..., axis] / self.period, q[..., 1 - axis]]
            known = np.isfinite(q).all(-1)
            out[known, axis] = map_coordinates(
                field, [a[known] for a in at], order=1, mode="nearest"
            )
        return out

    def _slipped(self, q: Floats, steps: Mask, rng: np.random.Generator) -> Floats:
        """Shift patches by a period; half of them lie on depth steps, where links are false."""
        q = q.copy()
        seen = np.asarray(np.isfinite(q).all(-1))
        for places in (seen & steps, seen):
            patches = _patches(places, self.slips / 2, (0.01, 0.035), rng)
            q[patches, rng.integers(2)] += self.period * rng.choice([-1, 1])
        return q


@dataclass(frozen=True)
class Plain:
    """Independent errors, of which bounds are known."""

    sigma: float
    """Standard deviation of the noise, pattern pixels."""
    outliers: float = 0.0
    """Share of gross errors."""
    missing: float = 0.0
    """Share of the image in patches without a reading."""
    outlier_px: float = 30.0
    """Standard deviation of a gross error, pattern pixels."""

    def apply(self, q: Floats, seed: int) -> Floats:
        """Return coordinates (H, W, 2) with errors, pattern pixels."""
        rng = np.random.default_rng(seed)
        read = q + self.sigma * rng.standard_normal(q.shape)
        far = self.outlier_px * rng.standard_normal(q.shape)
        read = read + np.where(self.gross(q.shape[:2], seed)[..., None], far, 0.0)
        places = np.asarray(np.isfinite(q).all(-1))
        read[_patches(places, self.missing * float(places.mean()), (0.02, 0.08), rng)] = np.nan
        return read

    def gross(self, shape: tuple[int, ...], seed: int) -> Mask:
        """Return which pixels (H, W) are gross errors."""
        return np.random.default_rng(10_000 + seed).random(shape) < self.outliers


def beside_steps(q: Floats) -> Mask:
    """Return the pixels (H, W) next to a jump of the coordinates or to where they end."""
    jump = np.zeros(q.shape[:2], bool)
    for axis in (0, 1):
        change = np.linalg.norm(np.diff(q, axis=axis), axis=-1)
        usual = np.nanmedian(change)
        torn = ~(change < _JUMP * usual)  # NaN counts
        first, second = [slice(None)] * 2, [slice(None)] * 2
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        jump[tuple(first)] |= torn
        jump[tuple(second)] |= torn
    return jump & np.isfinite(q).all(-1)


def _mixed(q: Floats, steps: Mask, rng: np.random.Generator) -> Floats:
    """Blend pixels beside a step with the other side; every second one is not read at all."""
    turn = rng.integers(-1, 2, (*q.shape[:2], 2))
    y, x = np.mgrid[: q.shape[0], : q.shape[1]]
    y = np.clip(y + turn[..., 0], 0, q.shape[0] - 1)
    x = np.clip(x + turn[..., 1], 0, q.shape[1] - 1)
    share = rng.random(q.shape[:2])[..., None]
    blended = share * q + (1 - share) * q[y, x]
    blended[rng.random(q.shape[:2]) < 0.5] = np.nan
    return np.where(steps[..., None], blended, q)


def _patches(
    places: Mask, share: float, radii: tuple[float, float], rng: np.random.Generator
) -> Mask:
    """Return discs (H, W) centred on some of ``places`` that cover a share of the image.

    Less where a disc on every place does not cover it.
    """
    height, width = places.shape
    y, x = np.mgrid[:height, :width]
    centres = np.argwhere(places)
    done = np.zeros(places.shape, bool)
    for cy, cx in centres[rng.permutation(len(centres))]:
        if done.mean() >= share:
            break
        a, b = width * rng.uniform(*radii, 2)
        disc = ((x - cx) / a) ** 2 + ((y - cy) / b) ** 2 < 1
        done |= maximum_filter(disc, 2)
    return done
