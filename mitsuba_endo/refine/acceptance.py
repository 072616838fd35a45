"""Which refined cells are to be believed."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .alternative_shifts import contest
from .cells import Image, mean
from .iterate import FAINT, Comparison, Refined

LEAST = 0.3
"""Correlation of image and model, and ..."""
USUAL = 0.75
"""... its share of the image's median, that a cell must reach."""
UNSTEADY = 0.25
"""Longest last step, pattern pixels."""
UNCERTAIN = 1.0
"""Largest standard deviation, pattern pixels: a twelfth of the coded grid's period."""
APART = 1.0
"""Pattern pixels by which a correction may differ from the median of those around."""
AROUND = 5
"""Cells of that neighbourhood's side."""
COVERED = 0.15
"""Share of a full window that must hold usable pixels."""
BEATEN = -0.005
"""Margin to the best alternative under which the alternative has won."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What of a refinement holds; arrays (h, w) of cells."""

    good: NDArray[np.bool_]
    """The image confirms the refined coordinate."""
    beaten: NDArray[np.bool_]
    """The image looks like another place of the pattern, a whole period away."""
    margin: Image
    """By how much the correlation here exceeds the best alternative's."""
    correlation: Image
    """Of the image with the model, offset and its slope taken away; 0 to 1."""


def judge(frame: Comparison, refined: Refined, covariance: Image) -> Verdict:
    """Judge every cell of a refinement.

    Args:
        frame: image and windows.
        refined: what came out.
        covariance: (h, w, 3) of the cells.
    """
    shape = frame.windows.shape
    fit = refined.fit
    explained = 1 - fit.residual / np.maximum(fit.variation, 1e-12)
    correlation = np.sqrt(np.clip(explained, 0, 1)).reshape(shape).astype(np.float32)
    covered = _covered(frame) & (mean(frame.usable) > 0)
    usual = float(np.median(correlation[covered])) if covered.any() else 1.0
    own, alternative = contest(frame, refined)
    beaten = covered & (own - alternative < BEATEN) & (alternative >= LEAST)
    good = covered & ~beaten & (correlation >= max(LEAST, USUAL * usual))
    good &= fit.gain.reshape(shape) > FAINT
    good &= np.linalg.norm(refined.step, axis=-1) < UNSTEADY
    good &= _agrees(refined.moved)
    largest = np.maximum(covariance[..., 0], covariance[..., 2])
    good &= (largest > 0) & (largest < UNCERTAIN**2)
    return Verdict(good, beaten, own - alternative, correlation)


def _covered(frame: Comparison) -> NDArray[np.bool_]:
    """Return the cells whose windows hold enough usable pixels."""
    held = frame.windows.moments([mean(frame.usable)]).of(0, 0).reshape(frame.windows.shape)
    return np.asarray(held >= COVERED * held.max(initial=1e-9))


def _agrees(moved: Image) -> NDArray[np.bool_]:
    """Tell the cells whose correction is like that of the cells around."""
    median = [cv2.medianBlur(np.ascontiguousarray(moved[..., k]), AROUND) for k in (0, 1)]
    return np.asarray(np.abs(moved - np.stack(median, -1)).max(-1) < APART)
