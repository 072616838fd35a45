"""The images of one axis by what they show, and the signals of its bits."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .phase_shift import wrapped_coordinate
from .stack_plan import Axis, StackPlan

Images = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class AxisImages:
    """Images of any shape (...), the same for all, linear brightness."""

    white: Images
    black: Images
    bits: Images
    """(bits, ...), coarsest first; none without a code."""
    inverses: Images | None
    """(bits, ...) likewise."""
    waves: list[Images]
    """(steps, ...) of each period, coarsest first."""

    @property
    def contrast(self) -> Images:
        """(...) white over black."""
        return self.white - self.black

    def signals(self, noise: float) -> tuple[Images, Images]:
        """Return the bits' signals (bits, ...) from -1 to 1, and their standard deviation (...).

        Args:
            noise: standard deviation of the brightness.
        """
        safe = np.maximum(self.contrast, np.float32(1e-6))
        if self.inverses is not None:
            return (self.bits - self.inverses) / safe, np.float32(np.sqrt(2) * noise) / safe
        # The threshold is the mean of two measured levels, so its own noise counts too.
        signal = (2 * self.bits - self.white - self.black) / safe
        return signal, np.float32(np.sqrt(6) * noise) / safe


def labels_needed(plan: StackPlan, axis: Axis) -> list[str]:
    """Return the labels of the images that decoding an axis takes."""
    own = [*plan.reference_labels(), *plan.axis_labels(axis)]
    # Along one axis, the first stripe is dark in every image.
    return own if plan.reference or plan.inverse or plan.periods else plan.labels()


def axis_images(images: Mapping[str, Images], plan: StackPlan, axis: Axis) -> AxisImages:
    """Sort images, by label, of :func:`labels_needed`."""
    bits = _stack(images, plan.bit_labels(axis))
    inverses = _stack(images, plan.inverse_labels(axis)) if plan.inverse else None
    waves = [_stack(images, steps) for steps in plan.phase_labels(axis)]
    white, black = _levels(images, plan, bits, inverses, waves)
    return AxisImages(white, black, bits, inverses, waves)


def _stack(images: Mapping[str, Images], labels: list[str]) -> Images:
    return np.stack([images[label] for label in labels]) if labels else np.empty(0, np.float32)


def _levels(
    images: Mapping[str, Images],
    plan: StackPlan,
    bits: Images,
    inverses: Images | None,
    waves: list[Images],
) -> tuple[Images, Images]:
    """Return each pixel's brightness under white and under black."""
    if plan.reference:
        return images["white"], images["black"]
    if waves:
        finest = waves[-1]
        mean, swing = finest.mean(0), wrapped_coordinate(finest, 1.0)[1]
        return mean + swing / 2, mean - swing / 2
    if inverses is not None:
        # The median, since blur may wash out the finest bits.
        pair = np.maximum(bits, inverses), np.minimum(bits, inverses)
        return np.median(pair[0], 0), np.median(pair[1], 0)
    everything = np.stack(list(images.values()))
    return everything.max(0), everything.min(0)
