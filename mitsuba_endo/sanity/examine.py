"""All checks of what was given, in one call."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..records.consistency import check_maps
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig
from .camera_matrix import focal_units, principal_point
from .coordinate_units import half_precision, normalised, one_based
from .finding import Check, Finding
from .handedness import handedness
from .lens_fold import lens_fold
from .missing_values import missing_values
from .projector_intrinsics import projector_focal

CHECKS: tuple[Check, ...] = (
    normalised, focal_units, principal_point, handedness, lens_fold, projector_focal, one_based,
    half_precision,
)  # fmt: skip
"""In the order in which they run: a camera matrix in other units also folds its lens."""


@dataclass(frozen=True, eq=False)
class Examined:
    """What can be calibrated of what was given, and what looks wrong with it."""

    maps: list[CorrespondenceMap]
    """Without the pixels that must not be used."""
    findings: list[Finding]

    @property
    def warnings(self) -> list[str]:
        return [finding.warning for finding in self.findings]

    @contextmanager
    def told_on_failure(self) -> Iterator[None]:
        """Add what looks wrong to an :class:`InputError` raised inside: it is the likely cause."""
        try:
            yield
        except InputError as error:
            if not self.findings:
                raise
            doubts = "; ".join(self.warnings)
            todo = f"{error.todo}; a likely cause: {doubts}" if error.todo else doubts
            raise type(error)(error.what, error.where, todo) from error


def examine(maps: Sequence[CorrespondenceMap], rig: Rig) -> Examined:
    """Look at maps and rig before anything is solved.

    Raises:
        InputError: see :func:`mitsuba_endo.records.consistency.check_maps`, or a mistake with
            which no calibration can be right; names it and what to do.
    """
    findings = missing_values(maps)
    examined = Examined(without_unusable(maps, findings), findings)
    with examined.told_on_failure():
        check_maps(examined.maps, rig)
    for check in CHECKS:
        with examined.told_on_failure():
            of_check = check(examined.maps, rig)
            for finding in of_check:
                if finding.refused:
                    raise finding.error
        examined = Examined(
            without_unusable(examined.maps, of_check), [*examined.findings, *of_check]
        )
    return examined


def without_unusable(
    maps: Sequence[CorrespondenceMap], findings: Sequence[Finding]
) -> list[CorrespondenceMap]:
    """Return the maps with the pixels that findings name set to NaN."""
    out = list(maps)
    for k, pixels in ((k, p) for f in findings for k, p in f.unusable.items()):
        q = np.where(pixels[..., None], np.float32(np.nan), out[k].q)
        out[k] = replace(out[k], q=q)
    return out
