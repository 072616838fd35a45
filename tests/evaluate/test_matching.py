"""Which frame is which: by name and nothing else, unless somebody asks for the order."""

import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.evaluate.matching import match_names


def _matched(found: list[str], true: list[str], **options: str) -> tuple[list[int], str]:
    return match_names(found, [(name,) for name in true], **options)  # type: ignore[arg-type]


def test_names_match_whatever_the_order():
    """Oracle: by hand: suffixes do not count, a bare name fits one with a folder."""
    assert _matched(["b.exr", "a.exr"], ["a.exr", "b.exr", "c.exr"]) == ([1, 0], "name")
    assert _matched(["b.exr"], ["a.npz", "b.npz"]) == ([1], "name")
    assert _matched(["left/map.exr", "right/map.exr"], ["right/map", "left/map"]) == (
        [1, 0], "name",
    )  # fmt: skip
    assert _matched(["a.exr"], ["run/b.exr", "run/a.exr"]) == ([1], "name")
    assert _matched(["frame_1.5.exr"], ["frame_1.6", "frame_1.5"]) == ([1], "name")


def test_an_image_s_name_is_another_name_of_its_frame():
    """Oracle: the second of two captures, by what was decoded from its photograph."""
    true = [("f1/map.exr", "f1/image.png"), ("f2/map.exr", "f2/image.png")]
    assert match_names(["f2/image.exr", "f1/image.exr"], true) == ([1, 0], "name")


@pytest.mark.parametrize(
    ("found", "true", "words"),
    [
        (["x"], ["a", "b"], "frame x: no frame of this name in the truth, which has a, b"),
        (["x", "y"], ["a", "b"], "frame x: no frame of this name"),
        (["left/map.exr"], ["right/map.exr"], "in another folder, right/map.exr"),
        (["left/map.exr", "b/x"], ["right/map.exr", "b/x"], "in another folder, right/map.exr"),
        (["map.exr"], ["left/map.exr", "right/map.exr"], "may be left/map.exr, right/map.exr"),
        (["a/map.exr", "b/map.exr"], ["map.exr"], "a/map.exr and b/map.exr are both called as"),
    ],
)
def test_what_cannot_be_paired_is_refused(found: list[str], true: list[str], words: str):
    """Oracle: the names in the message; a base name alone is no match when folders differ."""
    with pytest.raises(InputError, match=words.replace("+", r"\+")):
        _matched(found, true)


def test_order_counts_only_when_asked_for():
    """Oracle: by hand; one frame on each side leaves no choice."""
    assert _matched(["x", "y"], ["a", "b"], by="order") == ([0, 1], "order")
    assert _matched(["x"], ["a"]) == ([0], "only")
    with pytest.raises(InputError, match="3 frames, and the solution has 2"):
        _matched(["x", "y"], ["a", "b", "c"], by="order")
