"""Random images for training: tissue albedo, wet highlights, and pictures without a pattern."""

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
Picture = NDArray[np.floating]


def clouds(shape: tuple[int, int], grain: float, rng: np.random.Generator) -> Image:
    """Return smooth noise (H, W) of zero mean and unit variance, ``grain`` pixels coarse."""
    h, w = shape
    rows, columns = (int(np.ceil(n / grain)) + 3 for n in shape)
    field = rng.standard_normal((rows, columns), np.float32)
    size = (int(columns * grain) + 1, int(rows * grain) + 1)
    cut = cv2.resize(field, size, interpolation=cv2.INTER_CUBIC)[:h, :w]
    return (cut - cut.mean()) / (cut.std() + np.float32(1e-6))


def albedo(shape: tuple[int, int], rng: np.random.Generator) -> Image:
    """Return reflectance (H, W) of tissue: blotches, and vessels as dark ridges of noise."""
    result = np.ones(shape, np.float32)
    for grain in (60.0, 25.0, 9.0, 4.0):
        result += rng.uniform(0, 0.12) * clouds(shape, grain, rng)
    if rng.random() < 0.7:
        depth = rng.uniform(0.1, 0.6)
        for grain in rng.uniform(14, 70, rng.integers(1, 4)):
            ridge = np.abs(clouds(shape, float(grain), rng))
            result *= 1 - depth * np.exp(-((ridge / rng.uniform(0.04, 0.12)) ** 2))
    return np.clip(result, 0.08, 1.8)


def highlights(facing: Image, rng: np.random.Generator) -> Image:
    """Return the strength (H, W) of wet reflections over a share of up to a tenth of the pixels.

    They lie where the surface faces the light, broken up by relief.
    """
    share = min(rng.exponential(0.03), 0.1)
    rough = clouds(facing.shape, float(rng.uniform(3, 9)), rng)
    rough = rough + rng.uniform(0.5, 2) * clouds(facing.shape, float(rng.uniform(10, 40)), rng)
    field = rng.uniform(1, 12) * facing + rng.uniform(0.3, 1) * rough
    level = np.quantile(field[::3, ::3], 1 - share)
    # From sharp spots to a veil far around them.
    width = float(np.exp(rng.uniform(np.log(0.05), np.log(3))))
    grains = np.exp(rng.uniform(0, 0.7) * clouds(facing.shape, float(rng.uniform(1.5, 4)), rng))
    return (np.clip((field - level) / width + 0.5, 0, 1) * grains).astype(np.float32)


def without_pattern(shape: tuple[int, int], rng: np.random.Generator) -> Image:
    """Return a picture (H, W) that holds no coded grid, brightness about 0 to 1."""
    maker = (_tissue, _stripes, _noise, _things, _flat)[int(rng.integers(5))]
    return np.maximum(maker(shape, rng), 0).astype(np.float32)


def _tissue(shape: tuple[int, int], rng: np.random.Generator) -> Picture:
    light = np.exp(rng.uniform(0.2, 1) * clouds(shape, 90.0, rng))
    return 0.5 * albedo(shape, rng) * light


def _stripes(shape: tuple[int, int], rng: np.random.Generator) -> Picture:
    """Lines in one direction only, or a checkerboard."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    angle, period = rng.uniform(0, np.pi), rng.uniform(5, 20)
    along = (x * np.cos(angle) + y * np.sin(angle)) / period + 0.2 * clouds(shape, 80.0, rng)
    across = (y * np.cos(angle) - x * np.sin(angle)) / period
    if rng.random() < 0.3:
        return ((np.floor(along) + np.floor(across)) % 2).astype(np.float32)
    away = along - np.round(along)
    return np.exp(-0.5 * (away / rng.uniform(0.05, 0.25)) ** 2).astype(np.float32)


def _noise(shape: tuple[int, int], rng: np.random.Generator) -> Picture:
    field = clouds(shape, float(rng.uniform(1.0, 8)), rng)
    return np.clip(0.4 + rng.uniform(0.05, 0.4) * field, 0, 2)


def _things(shape: tuple[int, int], rng: np.random.Generator) -> Picture:
    """Polygons, discs, lines and letters, as in a photograph of something else."""
    h, w = shape
    # Letters are drawn on 8 bits only.
    canvas = np.full(shape, rng.integers(256), np.uint8)
    for _ in range(rng.integers(10, 60)):
        grey = float(rng.integers(256))
        x, y = (int(v) for v in rng.uniform(0, [w, h]))
        kind = rng.integers(4)
        if kind == 0:
            cv2.circle(canvas, (x, y), int(rng.integers(2, 40)), grey, -1, cv2.LINE_AA)
        elif kind == 1:
            corners = (np.array([x, y]) + rng.normal(0, 25, (4, 2))).astype(np.int32)
            cv2.fillPoly(canvas, [corners], grey, cv2.LINE_AA)
        elif kind == 2:
            end = tuple(int(v) for v in rng.uniform(0, [w, h]))
            cv2.line(canvas, (x, y), end, grey, int(rng.integers(1, 5)), cv2.LINE_AA)
        else:
            cv2.putText(canvas, chr(int(rng.integers(33, 120))) * 2, (x, y), 0,
                        rng.uniform(0.4, 3), grey, 2, cv2.LINE_AA)  # fmt: skip
    return canvas.astype(np.float32) / 255 + np.float32(0.05) * clouds(shape, 2.0, rng)


def _flat(shape: tuple[int, int], rng: np.random.Generator) -> Picture:
    return np.full(shape, rng.choice([0.0, 0.02, 0.5, 3.0]), np.float32)
