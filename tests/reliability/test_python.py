"""What somebody gives from Python that is no map, no list, no rig.

Oracle: an ``InputError`` that says what it is and what to give.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.consistency import as_maps, check_maps
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Rig
from mitsuba_endo.solve.calibrate import calibrate
from tests.cli.inputs import q, rig

RIG = Rig.model_validate(rig())


def _map(**changes: Any) -> CorrespondenceMap:
    return CorrespondenceMap(**{"q": q(), "name": "map.npz"} | changes)


def test_maps_in_any_order_of_things_are_taken():
    """Oracle: the same maps from a list, a tuple and a generator."""
    maps = [_map(), _map(name="b")]
    for given in (maps, tuple(maps), (m for m in maps)):
        assert as_maps(given) == maps


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (_map(), "maps: is 'CorrespondenceMap' and no list"), ("a.npz", "'str' and no list"),
        (Path("a.npz"), "and no list"), (3, "'int' and no list"), (None, "and no list"),
        (["a.npz"], r"maps\[0\]: is 'str' and no map"), ([q()], r"maps\[0\]: is 'ndarray'"),
        ([_map(q=q()[..., 0])], r"map.npz: map: q is \(14, 24\)"),
        ([_map(q=np.concatenate([q(), q()], -1))], r"q is \(14, 24, 4\)"),
        ([_map(q=q().tolist())], "q is list"), ([_map(q=q().astype(str))], "q is"),
        ([_map(weight=np.ones((3, 3)))], r"weight is \(3, 3\)"),
        ([_map(weight=np.full((14, 24), np.nan))], "weight is negative or missing"),
        ([_map(weight=np.full((14, 24), -0.5))], "weight is negative or missing"),
        ([_map(weight=[1.0])], "weight is list"),
    ],
)  # fmt: skip
def test_what_is_no_list_of_maps(given: Any, words: str):
    with pytest.raises(InputError, match=words):
        as_maps(given)
    with pytest.raises(InputError, match=words):
        calibrate(given, RIG)


@pytest.mark.parametrize("given", ["rig.yaml", Path("rig.yaml"), rig(), None])
def test_what_is_no_rig(given: Any):
    with pytest.raises(InputError, match=r"rig: is '\w+' and no rig; give load_rig"):
        check_maps([_map()], given)
    with pytest.raises(InputError, match=r"rig: is '\w+' and no rig; give load_rig"):
        calibrate([_map()], given)


@pytest.mark.parametrize("width", [0, -1, 65_537, 1_000_000, 10**30])
def test_a_pattern_of_a_million_pixels_is_no_pattern(width: int):
    """It led to a verdict that said measured and not determined of one value."""
    data = rig()
    data["projector"]["width"] = width
    with pytest.raises(ValueError, match="width"):
        Rig.model_validate(data)
