"""The default start on random rigs, without any guess."""

import sys
from functools import partial
from pathlib import Path

import numpy as np

from .report import Figure, timed

sys.path.insert(0, str(Path(__file__).parents[2]))  # the tests' rigs are truth that shares no code
from tests.initialisation.success import succeeds

NAME = "start"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Start on rig after rig: rotation to 20 degrees, focal length 0.5-1.8 times the projector's
    width, both laws, sheets and spheres, 0.3 px of noise and up to 30 % of gross outliers.
    """
    rigs = 8 if quick else 100
    seconds, right = np.array([timed(lambda seed=seed: succeeds(seed)) for seed in range(rigs)]).T
    return [
        _figure("rigs", rigs, "", ""),
        _figure("starts within 1 % and 2 degrees, or 4 sigma", 100 * float(right.mean()), "%",
                "higher", 99),
        _figure("time of a start, median", float(np.median(seconds)), "s", "lower"),
        _figure("time of a start, worst", float(seconds.max()), "s", "lower"),
    ]  # fmt: skip
