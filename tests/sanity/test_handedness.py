"""Maps that turn the other way round than an opaque surface allows are refused by name."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from mitsuba_endo.errors import InputError
from mitsuba_endo.sanity.examine import examine
from mitsuba_endo.sanity.handedness import handedness, local_jacobians, positive_share
from mitsuba_endo.solve.frames.initial_poses import without_faults
from tests.rigs import Rig
from tests.sanity.given import map_of, noisy, record, thinned

WRONG: dict[str, Callable[[Rig], NDArray]] = {
    "x_mirrored": lambda r: r.q * [-1, 1] + [r.size[0] - 1, 0],
    "y_upwards": lambda r: r.q * [1, -1] + [0, r.size[1] - 1],
    "swapped": lambda r: r.q[..., ::-1],
    "swapped_and_turned": lambda r: r.q[..., ::-1] * -1 + [r.size[1] - 1, r.size[0] - 1],
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_maps_are_named(name: str):
    """Oracle: what was done to the map, under 1 px noise, 30 % outliers and rotations to 20 deg."""
    for seed in range(6):
        rig = noisy(seed)
        (finding,) = handedness([map_of(WRONG[name](rig))], record(rig))
        assert (finding.kind, finding.refused) == (f"handedness_{name}", True)


def test_the_images_own_mirroring_counts_too():
    """Oracle: a camera image flipped left to right or top to bottom is a mirrored map as well."""
    rig = noisy(5)
    for q, name in ((rig.q[:, ::-1], "x_mirrored"), (rig.q[::-1], "y_upwards")):
        (finding,) = handedness([map_of(q)], record(rig))
        assert finding.kind == f"handedness_{name}"


def test_a_half_turn_is_legitimate():
    """Oracle: an endoscope's projector may be upside down; a rotation keeps the determinant."""
    rig = noisy(8)
    q = rig.q * -1 + [rig.size[0] - 1, rig.size[1] - 1]
    assert positive_share(local_jacobians(map_of(q))) > 0.9
    assert handedness([map_of(q)], record(rig)) == []


def test_between_two_reflections_it_is_just_mirrored():
    """Oracle: mirrored and turned by 45 degrees it is neither mirrored nor swapped."""
    y, x = np.mgrid[:90, :120]
    q = np.stack([200 - x + y, x + y], -1)
    (finding,) = handedness([map_of(q)], record(noisy(1)))
    assert finding.kind == "handedness_mirrored"


def test_garbage_is_not_called_mirrored():
    """Oracle: independent random coordinates have either sign equally often."""
    rng = np.random.default_rng(0)
    q = rng.uniform(0, 300, (180, 240, 2))
    assert 0.35 < positive_share(local_jacobians(map_of(q))) < 0.65
    assert handedness([map_of(q)], record(noisy(1))) == []


def test_sparse_mirrored_map():
    """Oracle: one pixel in nine still says which way it turns."""
    rig = thinned(noisy(2), 3)
    (finding,) = handedness([map_of(WRONG["x_mirrored"](rig))], record(rig))
    assert finding.kind == "handedness_x_mirrored"


def test_refusal_names_frames_and_what_to_do():
    """Oracle: the contract; where every frame is mirrored, they are refused by their names."""
    rig = noisy(5)
    maps = [map_of(WRONG["x_mirrored"](rig), name) for name in ("a.exr", "b.exr")]
    with pytest.raises(
        InputError, match=r"^a\.exr, b\.exr: map: projector\.x runs against"
    ) as error:
        examine(maps, record(rig))
    assert "store width - 1 - x" in str(error.value)


def test_one_mirrored_frame_among_right_ones_is_named_and_left_out():
    """Oracle: the contract; a warning names the frame, and the solver does without it."""
    rig = noisy(5)
    maps = [map_of(rig.q, "a.exr"), map_of(WRONG["x_mirrored"](rig), "b.exr")]
    (warning,) = [w for w in examine(maps, record(rig)).warnings if "runs against" in w]
    assert warning.startswith("b.exr: map: projector.x runs against")
    kept, left_out = without_faults(maps, record(rig))
    assert [m.name for m in kept] == ["a.exr"]
    assert [f.name for f in left_out] == ["b.exr"]
    assert "runs against" in left_out[0].reason
