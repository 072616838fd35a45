"""The iterations: look the pattern up, compare it with the image, move, until steps are small."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..robust import robust_std
from .cells import SIDE, Image, Links, blend
from .image_view import ImageView
from .options import RefineOptions
from .pattern_image import PatternImage
from .regression import Ridges, WindowFit, normal_equations, solve
from .smoother import Smoother
from .windows import Windows

DARK = 0.7
"""Light, in medians of the image, up to which errors are alike; above, they grow with it: noise of
the sensor there, speckle here."""
ROBUST = 4.0
"""Scales of the residual at which a pixel counts half (Cauchy): glints of wet tissue."""
FIRST_SCALE = 0.1
"""Relative residual assumed before any is known."""
GAIN_SLOPE = 0.05
"""Prior standard deviation of the gain's relative change over one camera pixel, and of the offset's
over the gain: shading and vessels change brightness by a half over a period of 10 pixels."""
SHIFT = 0.6
"""Prior standard deviation of a step, pattern pixels: what a decoder may be wrong by."""
ALIKE = 4.0
"""Pixels whose errors are alike: grains of speckle, the lens's blur."""
FAINT = 0.1
"""Least gain, in medians of the image: fainter, the pattern cannot be seen."""
LONGEST = 2.0
"""Longest step of one iteration, pattern pixels."""
ENOUGH = 0.01
"""Root mean square step, pattern pixels, at which they end: a tenth of the errors left."""
CORE = 0.8
"""Blur of the pattern looked up over the one that fits best. Light scattered in tissue has wide,
uneven tails that would pull on a pattern as wide; the narrower one looks at the core of lines."""
BLURS = (0.3, 3.0)
"""Between them the blur lies, pattern pixels."""
FIRST_BLUR = 0.6
"""Blur of the pattern before it is fitted, pattern pixels. Chosen within :data:`BLURS`."""
FITTED = 2
"""Iterations after which the blur is fitted."""


@dataclass(frozen=True, eq=False)
class Refined:
    """Coordinates where the image wants them, and what the uncertainty is made from."""

    q: Image
    """(H, W, 2) pattern pixels, finite everywhere; H and W whole cells."""
    moved: Image
    """(h, w, 2) by which a cell moved in all."""
    step: Image
    """(h, w, 2) by which it moved in the last iteration."""
    fit: WindowFit
    """The last regression."""
    predicted: Image
    """(H, W) the image as the model has it."""
    derivatives: tuple[Image, Image]
    """(H, W) of the pattern along its x and y."""
    scale: float
    """Robust standard deviation of the relative residual."""
    blur: float
    """Of the pattern, pattern pixels."""
    weight: Image
    """(H, W) of the pixels in the last regression."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """What stays the same over all iterations."""

    view: ImageView
    usable: Image
    """(H, W) 1 where a pixel has a coordinate and is clear, else 0."""
    links: Links
    windows: Windows
    smoother: Smoother
    """Of corrections, under wider windows."""
    pattern: PatternImage


def iterate(
    frame: Comparison, start: Image, options: RefineOptions, blur: float | None = None
) -> Refined:
    """Move coordinates to where image and pattern agree.

    The correction is always the windowed one from a base: the start plus the correction so far,
    smoothed. So noise is averaged over the window once, however many iterations there are, and what
    is smooth in the start's error is removed altogether.

    Args:
        frame: image, pattern and windows.
        start: (H, W, 2) smooth coordinates, finite.
        options: how many iterations, and the blur if it is given.
        blur: to begin with; None: the usual one.
    """
    moved = np.zeros((*frame.windows.shape, 2), np.float32)
    base = moved
    blur = options.blur or blur or FIRST_BLUR
    refined = None
    for k in range(max(1, options.iterations)):
        refined = _linearise(frame, start, base, moved, blur, refined)
        moved = refined.moved
        if options.blur is None and k < FITTED:
            blur = _fitted_blur(frame, refined)
        if float(np.sqrt(np.mean(refined.step**2))) < ENOUGH:
            break
        base = frame.smoother.of_cells(moved)
    assert refined is not None
    return replace(refined, q=start + blend(moved, frame.links))


def _linearise(
    frame: Comparison, start: Image, base: Image, moved: Image, blur: float, before: Refined | None
) -> Refined:
    """Compare image and pattern once, at ``start`` + ``moved``, and correct from ``base`` on."""
    q = start + blend(moved, frame.links)
    value, along_x, along_y = frame.pattern.look_up(q, blur)
    away = blend(moved - base, frame.links)
    value_at_base = value - along_x * away[..., 0] - along_y * away[..., 1]
    weight = frame.usable / (DARK + np.maximum(frame.view.light, 0)) ** 2
    scale = FIRST_SCALE
    if before is not None:
        scale = before.scale
        weight = frame.usable / (DARK + np.maximum(before.predicted, 0)) ** 2
        weight *= robust_weight(frame, before.predicted, scale)
    fields = [value_at_base, along_x, along_y, frame.view.light]
    fit = solve(normal_equations(frame.windows, weight, fields), _ridges(scale), FAINT)
    after = base + _grid(frame, np.clip(fit.shift, -LONGEST, LONGEST))
    brightness = blend(_grid(frame, np.stack([fit.gain, fit.offset], -1)), frame.links)
    predicted = brightness[..., 0] * value + brightness[..., 1]
    scale = residual_scale(frame, predicted)
    return Refined(q, after, after - moved, fit, predicted, (along_x, along_y), scale, blur, weight)


def relative_residual(frame: Comparison, predicted: Image) -> Image:
    """Return the residual (H, W) over what noise grows with."""
    return (frame.view.light - predicted) / (DARK + np.maximum(predicted, 0))


def residual_scale(frame: Comparison, predicted: Image) -> float:
    """Return the robust standard deviation of the relative residual."""
    used = relative_residual(frame, predicted)[frame.usable > 0]
    return max(robust_std(used[::7]), 1e-4) if used.size else FIRST_SCALE


def robust_weight(frame: Comparison, predicted: Image, scale: float) -> Image:
    """Return Cauchy weights (H, W) of the pixels."""
    z = relative_residual(frame, predicted) / np.float32(ROBUST * scale)
    return 1 / (1 + z * z)


def _ridges(scale: float) -> Ridges:
    # Normal matrices are sums over cells of means over pixels, and alike pixels count as one.
    variance = ALIKE * scale**2 / SIDE**2
    return Ridges(slope=variance / GAIN_SLOPE**2, shift=variance / SHIFT**2)


def _fitted_blur(frame: Comparison, refined: Refined) -> float:
    """Return the blur to go on with: one linear step of its variance s, for dT/ds = T''/2."""
    gain = blend(_grid(frame, refined.fit.gain[:, None]), frame.links)[..., 0]
    broadening = gain * frame.pattern.laplacian(refined.q, refined.blur)
    power = float((refined.weight * broadening**2).sum())
    if power == 0:
        return refined.blur
    more = (
        float((refined.weight * broadening * (frame.view.light - refined.predicted)).sum()) / power
    )
    best = float(np.sqrt(max(refined.blur**2 + 2 * more, 0)))
    return float(np.clip(CORE * best, *BLURS))


def _grid(frame: Comparison, values: NDArray) -> Image:
    return values.reshape(*frame.windows.shape, -1).astype(np.float32)
