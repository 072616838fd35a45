"""Options that mean nothing are refused when they are made."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.sequence.options import SequenceOptions
from mitsuba_endo.solve.options import Options


@pytest.mark.parametrize(
    ("field", "value", "what"),
    [
        ("max_iterations", 0, "greater than or equal to 1, got 0"),
        ("adam_iterations", -5, "greater than or equal to 1, got -5"),
        ("tolerance", -0.2, "greater than 0, got -0.2"),
        ("tolerance", np.inf, "finite number, got inf"),
        ("cell_px", 0.0, "greater than 0, got 0.0"),
        ("cell_px", np.nan, "finite number, got nan"),
        ("smoothness", -1.0, "greater than or equal to 0, got -1.0"),
        ("plane_distance", "far", "valid number, got 'far'"),
        ("start", "guess", "'search' or 'plane', got 'guess'"),
        ("surface", "sphere", "'lattice' or 'mesh', got 'sphere'"),
        ("finish", "huber", "'tukey' or 'cauchy', got 'huber'"),
        ("seed", -1, "greater than or equal to 0, got -1"),
        ("seed", 1.5, "valid integer, got 1.5"),
        ("jackknife", "no", "valid boolean, got 'no'"),
    ],
)
def test_refused(field: str, value: Any, what: str):
    """Oracle: one sentence with the field and the value, also of changed options."""
    for make in (Options, lambda **changes: replace(Options(), **changes)):
        with pytest.raises(InputError, match=f"^options: {field}: .*{what}"):
            make(**{field: value})


@pytest.mark.parametrize("field", ["voxel", "first", "fuse_every", "vertices"])
def test_those_of_sequences_too(field: str):
    """Oracle: likewise."""
    with pytest.raises(InputError, match=f"^options: {field}: .*got 0"):
        SequenceOptions(**{field: 0})


def test_what_means_something_is_taken_as_it_is():
    """Oracle: equality; whole numbers are lengths too, and None is the default of its field."""
    assert Options(plane_distance=8, cell_px=None, tolerance=np.float64(0.1)).plane_distance == 8
    assert SequenceOptions(vertices=None).vertices is None
