"""Maps and rig that do not belong together are refused before any work, in one sentence."""

import numpy as np
import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.records.consistency import MIN_CORRESPONDENCES, check_maps, fault
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Rig

WIDTH, HEIGHT = 20, 12


def _rig(**changes: object) -> Rig:
    data = {
        "camera": {"width": WIDTH, "height": HEIGHT, "K": [[30, 0, 9], [0, 31, 6], [0, 0, 1]]},
        "projector": {"width": 200, "height": 90},
        **changes,
    }
    return Rig.model_validate(data)


def _map(name: str = "map.npz", width: int = WIDTH, height: int = HEIGHT) -> CorrespondenceMap:
    y, x = np.mgrid[:height, :width]
    return CorrespondenceMap(np.stack([9 * x + 5, 7 * y + 3], -1).astype(np.float32), name)


def _sentence(maps: list[CorrespondenceMap], rig: Rig) -> str:
    with pytest.raises(InputError) as error:
        check_maps(maps, rig)
    return str(error.value)


def test_matching_maps_pass():
    """Oracle: the contract; nothing is raised."""
    check_maps([_map("a.npz"), _map("b.npz")], _rig())


def test_no_map():
    """Oracle: the contract."""
    assert "no correspondence map" in _sentence([], _rig())


def test_size_names_both_sizes_and_is_not_fooled_by_a_transposed_map():
    """Oracle: the sizes put in, width first."""
    text = _sentence([_map("a.npz"), _map("b.npz", width=HEIGHT, height=WIDTH)], _rig())
    assert text.startswith("b.npz: map: the map is 12 x 20 pixels")
    assert "camera.width x camera.height 20 x 12" in text


@pytest.mark.parametrize("count", [MIN_CORRESPONDENCES - 1, MIN_CORRESPONDENCES])
def test_too_few(count: int):
    """Oracle: the number of finite correspondences left in the map."""
    map_ = _map()
    map_.q.reshape(-1, 2)[count:] = np.nan
    if count >= MIN_CORRESPONDENCES:
        check_maps([map_], _rig())
    else:
        assert "map.npz: map: the map has 49 usable" in _sentence([map_], _rig())


def test_faulty_among_sound():
    """Oracle: the contract; useless maps matter only where there is no other, sizes always."""
    empty, sound = _map("empty.npz"), _map("sound.npz")
    empty.q[:] = np.nan
    check_maps([empty, sound], _rig())
    said = fault(empty, _rig())
    assert said is not None
    assert "0 usable" in said.what
    assert fault(sound, _rig()) is None
    assert _sentence([empty], _rig()).startswith("empty.npz: map: the map has 0 usable")
    assert "map is 12 x 20" in _sentence([sound, _map("c.npz", HEIGHT, WIDTH)], _rig())


def test_half_a_correspondence_is_none():
    """Oracle: a pixel with x but no y has no correspondence."""
    map_ = _map()
    map_.q[..., 1].reshape(-1)[MIN_CORRESPONDENCES - 1 :] = np.nan
    assert "49 usable" in _sentence([map_], _rig())


def test_coordinates_of_a_larger_pattern():
    """Oracle: of columns 9 x + 5, x = 0..19, the first seven (to 59) lie on 60 pixels."""
    text = _sentence([_map()], _rig(projector={"width": 60, "height": 90}))
    assert "only 35 %" in text
    assert "projector.width x projector.height = 60 x 90" in text


def test_frames_of_one_name():
    """Oracle: the contract; results are reported by frame name."""
    assert _sentence([_map(), _map()], _rig()).startswith("map.npz: two frames")


@pytest.mark.parametrize(
    ("known", "field"),
    [
        ({"pixels": [[1, 2], [19.2, 11.2]], "mm": 5, "frame": 1}, "known_distance.frame"),
        ({"pixels": [[1, 2], [11.0, 19.0]], "mm": 5}, "known_distance.pixels"),
    ],
)
def test_known_distance_outside_the_data(known: dict, field: str):
    """Oracle: one map of 20 x 12 pixels holds no frame 1 and no pixel (11, 19)."""
    assert f"scale.{field}" in _sentence([_map()], _rig(scale={"known_distance": known}))
