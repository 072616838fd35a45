"""InputError: one sentence with place, fault and remedy."""

import pytest

from mitsuba_endo.errors import InputError, NothingDecodedError


def test_sentence_has_place_fault_and_remedy():
    """Oracle: the sentence written out by hand."""
    error = InputError("is negative, got -3", "rig.yaml: projector.focal", "give a length in px")
    assert str(error) == "rig.yaml: projector.focal: is negative, got -3; give a length in px."


@pytest.mark.parametrize(
    ("where", "todo", "text"),
    [(None, None, "no frame."), ("a.npz", None, "a.npz: no frame."), (None, "do", "no frame; do.")],
)
def test_parts_left_out(where: str | None, todo: str | None, text: str):
    """Oracle: the sentence written out by hand."""
    assert str(InputError("no frame", where, todo)) == text


def test_exit_codes():
    """Oracle: the codes that the commands document: 2 for input, 3 for nothing decoded."""
    assert InputError("x").exit_code == 2
    assert NothingDecodedError("x").exit_code == 3
    assert issubclass(NothingDecodedError, InputError)
