"""Frames that repeat one another. Oracle: how camera and map were moved."""

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.solve.reporting.redundancy import (
    FrameView,
    alike,
    image_motion,
    redundancy_warnings,
)
from tests.rigs import lopsided_camera

CAMERA = lopsided_camera(108, 84)
RANGE = 12.0


def a_look(name: str = "a", seed: int = 0, noise: float = 0.2) -> FrameView:
    """A sphere about the camera that spans 320 x 250 pattern pixels."""
    y, x = np.mgrid[:84, :108]
    q = np.stack([40 + 3.0 * x, 30 + 3.0 * y], -1)
    q += noise * np.random.default_rng(seed).standard_normal(q.shape)
    points = RANGE * CAMERA.rays(CAMERA.pixel_grid())
    map_ = CorrespondenceMap(q.astype(np.float32), name)
    return FrameView(map_, points, RigidTransform.identity(), 0)


def shifted(look: FrameView, pixels: float) -> FrameView:
    return replace(look, map=CorrespondenceMap(look.map.q + np.float32(pixels), look.map.name))


def test_image_motion() -> None:
    """Oracle: a turn about x by one degree is f tan(1 degree) pixels at the middle, 1.4 here."""
    turned = replace(
        a_look(), world_from_camera=RigidTransform.of([np.radians(1), 0, 0], [0, 0, 0])
    )
    expected = 0.96 * 108 * np.tan(np.radians(1))
    assert image_motion(a_look(), turned, CAMERA) == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize(
    ("turn", "move", "shift", "same"),
    [
        (0.0, 0.0, 0.0, True),
        (0.2, 0.05, 1.0, True),
        (8.0, 0.0, 0.0, False),
        (0.0, 2.0, 0.0, False),
        (0.0, 0.0, 15.0, False),
    ],
    ids=["still", "nearly", "camera turned", "camera moved", "projector moved"],
)
def test_views_of_one_surface(turn: float, move: float, shift: float, same: bool) -> None:
    pose = RigidTransform.of([0, np.radians(turn), 0], [move, 0, 0])
    other = replace(shifted(a_look("b", 1), shift), world_from_camera=pose)
    assert alike(a_look(), other, CAMERA, 0.2) is same


def test_surfaces_of_their_own() -> None:
    """Without a common surface only the maps can tell: they differ by more than noise or not."""
    other = replace(a_look("b", 1), surface=1)
    assert alike(a_look(), other, CAMERA, 0.2)
    assert not alike(a_look(), shifted(other, 1.0), CAMERA, 0.2)


def test_maps_with_little_in_common() -> None:
    """Oracle: a third of either is in both."""
    left, right = a_look("a"), a_look("b", 1)
    left.map.q[:, 72:] = np.nan
    right.map.q[:, :60] = np.nan
    assert not alike(left, right, CAMERA, 0.2)


def with_object(view: FrameView, left: int) -> FrameView:
    """An object of a seventh of the image's width and height before the wall, 15 px off it."""
    q = view.map.q.copy()
    q[36:48, left : left + 15] += 15
    return replace(view, map=CorrespondenceMap(q, view.map.name))


@pytest.mark.parametrize("surface", [0, 1])
def test_small_object_that_moves_is_seen(surface: int) -> None:
    """Oracle: it covers 2 % of the image before and after; standing still it changes nothing."""
    before = with_object(a_look(), 20)
    still, moved = (replace(with_object(a_look("b", 1), x), surface=surface) for x in (20, 60))
    assert alike(before, still, CAMERA, 0.2)
    assert not alike(before, moved, CAMERA, 0.2)


@pytest.mark.parametrize("surface", [0, 1])
def test_gross_errors_do_not_make_frames_differ(surface: int) -> None:
    """Oracle: the same view, a tenth of whose correspondences are decoded wrongly."""
    other = replace(a_look("b", 1), surface=surface)
    wrong = np.random.default_rng(4).random(other.map.q.shape[:2]) < 0.1
    other.map.q[wrong] += 40
    assert alike(a_look(), other, CAMERA, 0.2)


def test_every_repeat_is_named_once() -> None:
    looks = [a_look("a"), a_look("b", 1), shifted(a_look("c", 2), 30), a_look("d", 3)]
    said = redundancy_warnings(looks, CAMERA, 0.2)
    (words,) = said
    assert words.startswith("2 frames are nearly identical to earlier ones (b and d):")
    assert redundancy_warnings(looks[:3], CAMERA, 0.2)[0].startswith("frames a and b are nearly")
