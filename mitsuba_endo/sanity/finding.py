"""What a check takes and returns."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records.correspondence import CorrespondenceMap
from ..records.rig import Rig


@dataclass(frozen=True, eq=False)
class Finding:
    """One likely mistake in what was given."""

    kind: str
    """Short name of the mistake, the same wherever it is found."""
    what: str
    """What is wrong, with the values, and the likely cause."""
    where: str
    """Frames or field of the rig."""
    todo: str
    """What to do about it."""
    refused: bool = False
    """Whether no calibration can come of it."""
    unusable: Mapping[int, NDArray[np.bool_]] = field(default_factory=dict)
    """Pixels (H, W) that must not be used, by the number of the frame."""

    @property
    def error(self) -> InputError:
        return InputError(self.what, self.where, self.todo)

    @property
    def warning(self) -> str:
        return f"{self.where}: {self.what}; {self.todo}"


Check = Callable[[Sequence[CorrespondenceMap], Rig], list[Finding]]
"""Looks at the maps, which have been found to belong to the rig, and the rig."""


def frames_named(names: Sequence[str]) -> str:
    """List up to three frames by name and count the rest."""
    shown = ", ".join(names[:3])
    return f"{shown} and {len(names) - 3} more" if len(names) > 3 else shown
