"""Inputs of other people that failed, where their folder is present: the kind is named."""

from pathlib import Path

import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.rig import load_rig
from mitsuba_endo.sanity.examine import Examined, examine

FIELD = Path(__file__).parents[3] / "shared" / "field"
pytestmark = pytest.mark.skipif(not FIELD.is_dir(), reason=f"{FIELD} is absent")


def _examined(folder: str, map_name: str, rig: str) -> Examined:
    return examine([load_map(FIELD / folder / map_name)], load_rig(FIELD / folder / rig))


def test_mirrored():
    """Oracle: the folder's README."""
    with pytest.raises(InputError, match="it is mirrored"):
        _examined("12_mirrored_map", "mirror.npz", "rig.yaml")


def test_lens_beyond_its_range():
    """Oracle: the folder's README: two fifths of the image lie beyond the coefficients' fold."""
    with pytest.raises(InputError, match=r"camera\.distortion: .*fold back inside the image"):
        _examined("22_lens_beyond_its_range", "map.exr", "m40_folding.yaml")


@pytest.mark.parametrize(
    ("folder", "map_name", "rig", "kinds"),
    [
        ("11_lens_shift_default_centre", "map.exr", "rig.yaml", []),
        ("15_zero_missing", "m03_zeromissing.npz", "m03_zeromissing.yaml", ["missing_value"]),
    ],
)
def test_named(folder: str, map_name: str, rig: str, kinds: list[str]):
    """Oracle: the folders' READMEs; a rig with the true centre draws nothing."""
    assert [f.kind for f in _examined(folder, map_name, rig).findings] == kinds


def test_part_of_a_picture():
    """Oracle: the folder's README: the coordinates lie in the second part."""
    map_ = load_map(FIELD / "16_exr_multipart" / "m22_multipart.exr")
    assert map_.q.shape == (180, 240, 2)
    assert map_.valid.mean() > 0.5
