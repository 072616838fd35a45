"""One training example: light on a stored view, through the camera, with its truth."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..capture.effects import apply_effects
from ..capture.settings import Effects
from ..decoding.grid_pattern import COLOURS
from .patterns import GridTexture
from .scattering import spread
from .textures import albedo, highlights
from .views import (
    BIT_EDGE,
    BIT_HIT,
    BIT_MIXED,
    LATTICE_UNIT,
    LEAST_FACING,
    SUPERSAMPLE,
    UNLIT,
    View,
)

VISIBLE = 0.01
"""Share of full scale that a line must reach for its pixel to count as lit."""
HARSH = 0.4
"""Share of images underexposed and full of speckle: few are both by chance."""
NEAR_NODE = 0.3
"""Periods, per axis, within which the node's code is asked for."""
BETWEEN_PX = 61
"""Side of the square over which light from wall to wall is spread, pixels: several periods."""
UNSPOILT = 0.1
"""Share of images without defocus and JPEG, in 16 bits."""
WITHOUT_SPECKLE = 0.25
"""Share of images without speckle, those included."""


@dataclass(frozen=True, eq=False)
class Targets:
    """What the network should give, per pixel."""

    lattice: NDArray[np.float32]
    """(2, H, W) column and row; 0 where not ``lit``."""
    lit: NDArray[np.bool_]
    """(H, W) lit by the grid, visible and not mixed."""
    code: NDArray[np.int8]
    """(H, W) channel of the nearest node's code: 0 = R, 1 = S, 2 = L; -1 where not asked for."""
    edge: NDArray[np.bool_]
    """(H, W) a depth edge passes within a pixel."""


@dataclass(frozen=True)
class Appearance:
    """Surface and light of one image; all that the camera itself does is in Effects."""

    scatter: float
    """Share of the laser's light that goes through the tissue."""
    free_path: float
    """Reduced mean free path there, pixels, where the tissue is nearest."""
    reflectance: float
    """Of the tissue: the brighter, the farther light spreads."""
    between: float
    """Light reflected from wall to wall, relative to the laser's."""
    lamp: float
    """Lamp light relative to the laser's lines."""
    wet: float
    """Strength of highlights; 0 = dry."""
    tint: tuple[float, float]
    """Red and blue of the tissue relative to its green, for colour images."""


def random_appearance(rng: np.random.Generator) -> Appearance:
    """Draw tissue and lamp."""
    u, soft = rng.uniform, rng.random() < 0.75
    return Appearance(
        scatter=u(0.5, 1) if soft else 0.0,
        free_path=float(np.exp(u(np.log(0.5), np.log(4)))),
        reflectance=u(0.2, 0.6),
        between=u(0, 0.25) if rng.random() < 0.7 else 0.0,
        lamp=float(np.exp(u(np.log(0.02), np.log(0.8)))) if rng.random() < 0.5 else 0.0,
        wet=float(np.exp(u(np.log(0.3), np.log(6)))) if rng.random() < 0.6 else 0.0,
        tint=(u(1, 2.4), u(0.5, 1.1)),
    )


def random_effects(rng: np.random.Generator) -> Effects:
    """Draw what camera and laser do, from clean to heavy corruption."""
    u, heavy = rng.uniform, rng.random()
    harsh = heavy > 1 - HARSH
    contrast = u(0.45, 0.85) if harsh else u(0, 0.85) * (heavy > WITHOUT_SPECKLE)
    exposure = (0.2, 0.6) if harsh else (0.18, 1.3)
    return Effects(
        vignetting=u(0, 1.2),
        defocus=0.0 if heavy < UNSPOILT else abs(rng.normal(0.5, 0.35)),
        motion=u(0.5, 4) if rng.random() < 0.2 else 0.0,
        motion_angle=u(0, 3.14),
        # Rounded: the table behind each contrast is kept.
        speckle_contrast=round(contrast, 2),
        speckle_grain=u(1.0, 2.6),
        exposure=float(np.exp(u(*np.log(exposure)))),
        colour="colour" if rng.random() < 0.55 else "gray",
        shot=float(np.exp(u(np.log(800), np.log(30000)))),
        read_noise=u(0, 16),
        gamma=float(rng.choice([1.0, 1.8, 2.2])),
        bits=16 if heavy < UNSPOILT else 8,
        jpeg_quality=int(rng.integers(45, 97))
        if heavy > UNSPOILT and rng.random() < 0.35
        else None,
    )


def crop_view(view: View, size: int, rng: np.random.Generator) -> View:
    """Return a random square of the view, mirrored along its axes and its diagonal by chance.

    Mirroring the image mirrors the lattice with it: the pattern itself is never mirrored.
    """
    h, w = view.flags.shape
    y, x = int(rng.integers(h - size + 1)), int(rng.integers(w - size + 1))
    top, left, many = SUPERSAMPLE * y, SUPERSAMPLE * x, SUPERSAMPLE * size
    lattice = view.lattice[top : top + many, left : left + many]
    shading, flags = (
        view.shading[y : y + size, x : x + size],
        view.flags[y : y + size, x : x + size],
    )
    mirrored = rng.random(2) < 0.5
    turn = np.s_[:: -1 if mirrored[1] else 1, :: -1 if mirrored[0] else 1]
    lattice, shading, flags = lattice[turn].copy(), shading[turn], flags[turn]
    for axis in np.flatnonzero(mirrored):
        # Negating UNLIT, the least of 16 bits, leaves it as it is.
        np.negative(lattice[..., axis], out=lattice[..., axis])
    if rng.random() < 0.5:
        lattice = lattice.transpose(1, 0, 2)[..., ::-1]
        shading, flags = shading.transpose(1, 0, 2), flags.T
    return View(lattice, np.ascontiguousarray(shading), np.ascontiguousarray(flags))


def compose(
    view: View,
    grid: GridTexture,
    appearance: Appearance,
    effects: Effects,
    rng: np.random.Generator,
) -> tuple[NDArray[np.integer], Targets]:
    """Return the photograph (H, W), 8 or 16 bit, of a view under a grid, and its targets."""
    fine = _lattice(view, grid, rng)
    h, w = view.flags.shape
    pattern = cv2.resize(grid.at(fine), (w, h), interpolation=cv2.INTER_AREA)
    shading = view.shading.astype(np.float32)
    tissue = albedo((h, w), rng)
    strength = tissue * shading[..., 0]
    laser = _scattered(pattern * strength, shading, appearance)
    lamp = appearance.lamp * tissue * shading[..., 1]
    wet = np.zeros((h, w), np.float32)
    if appearance.wet:
        shine = appearance.wet * highlights(shading[..., 2], rng)
        laser = (laser * (1 + shine * rng.uniform(0, 1))).astype(np.float32)
        wet = (shine * shading[..., 1] * rng.uniform(0.1, 1)).astype(np.float32)
    # The camera exposes for the pattern, or for the brightest of all.
    metered = laser if rng.random() < 0.6 else laser + lamp + wet
    gain = effects.exposure / max(float(np.percentile(metered[::2, ::2], 99.5)), 1e-6)
    image = _photograph(laser, lamp, wet, appearance, effects, gain, int(rng.integers(1 << 30)))
    return image, _targets(fine, strength * np.float32(gain) > VISIBLE, view.flags, grid)


def _photograph(
    laser: NDArray[np.float32], lamp: NDArray[np.float32], wet: NDArray[np.float32],
    appearance: Appearance, effects: Effects, gain: float, seed: int,
) -> NDArray[np.integer]:  # fmt: skip
    """Return the camera's image of the laser's, the tissue's and the wet film's light."""
    effects = effects.model_copy(update={"auto_exposure": False, "exposure": gain})
    if effects.colour == "gray":
        return apply_effects(laser + lamp + wet, effects, seed, laser=laser)
    tint = np.array([appearance.tint[0], 1, appearance.tint[1]], np.float32)
    laser_rgb = laser[..., None] * np.array(COLOURS["green"], np.float32)
    radiance = laser_rgb + lamp[..., None] * tint + wet[..., None]
    return apply_effects(radiance, effects, seed, laser=laser_rgb)


def _lattice(view: View, grid: GridTexture, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return column and row (2H, 2W, 2), NaN in shadow, with the grid's middle moved by chance."""
    middle = (np.array(grid.code.shape[::-1]) - 1) / 2 + rng.uniform(-2, 2, 2)
    lattice = view.lattice.astype(np.float32, order="C")
    lattice *= np.float32(LATTICE_UNIT)
    lattice += middle.astype(np.float32)
    lattice[view.lattice[..., 0] == UNLIT] = np.nan
    return lattice


def _scattered(
    light: NDArray[np.float32], shading: NDArray[np.float32], appearance: Appearance
) -> NDArray[np.float32]:
    """Spread the laser's light inside the tissue and from wall to wall."""
    if appearance.scatter:
        # The lamp's light falls with the squared distance.
        nearness = np.sqrt(shading[..., 1] / np.maximum(shading[..., 2], LEAST_FACING))
        inside = spread(light, nearness, appearance.free_path, appearance.reflectance)
        light = _sum(light, 1 - appearance.scatter, inside, appearance.scatter)
    if appearance.between:
        light = _sum(light, 1, cv2.blur(light, (BETWEEN_PX, BETWEEN_PX)), appearance.between)
    return light


def _sum(
    a: NDArray[np.float32], of_a: float, b: cv2.typing.MatLike, of_b: float
) -> NDArray[np.float32]:
    return np.asarray(cv2.addWeighted(a, of_a, b, of_b, 0), np.float32)


def _targets(
    fine: NDArray[np.float32], visible: NDArray[np.bool_], flags: NDArray[np.uint8],
    grid: GridTexture,
) -> Targets:  # fmt: skip
    n = SUPERSAMPLE
    corners = [fine[i::n, j::n] for i in range(n) for j in range(n)]
    lattice = sum(corners[1:], corners[0]) / np.float32(n * n)
    rows, columns = grid.code.shape
    node = np.nan_to_num(np.round(lattice), nan=-1).astype(np.int32)
    inside = (node >= 0).all(-1) & (node[..., 0] < columns) & (node[..., 1] < rows)
    lit = inside & visible & ((flags & BIT_MIXED) == 0) & ((flags & BIT_HIT) > 0)
    near = lit & (np.abs(lattice - node) < NEAR_NODE).all(-1)
    code = 1 - grid.code[np.where(inside, node[..., 1], 0), np.where(inside, node[..., 0], 0)]
    edge = cv2.dilate(((flags & BIT_EDGE) > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return Targets(
        lattice=np.where(lit[..., None], lattice, 0).astype(np.float32).transpose(2, 0, 1),
        lit=lit,
        code=np.where(near, code, -1).astype(np.int8),
        edge=edge,
    )


def no_targets(shape: tuple[int, int]) -> Targets:
    """Return the targets of an image without a grid."""
    h, w = shape
    no = np.zeros(shape, bool)
    return Targets(np.zeros((2, h, w), np.float32), no, np.full(shape, -1, np.int8), no)
