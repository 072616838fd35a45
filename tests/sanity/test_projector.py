"""What is assumed or implausible of the projector and the scale."""

import pytest

from mitsuba_endo.errors import InputError
from mitsuba_endo.sanity.examine import Examined, examine
from mitsuba_endo.sanity.working_distance import working_distance
from tests import rigs
from tests.sanity.given import map_of, record

RIG = rigs.random_rig(1)
MAP = map_of(RIG.q)


def test_projector_focal_in_millimetres():
    """Oracle: 8 px before 512 would spread over 176 degrees; a start of 300 px is plausible."""
    (finding,) = examine([MAP], record(RIG, focal=8.0)).findings
    assert finding.kind == "projector_focal_millimetres"
    assert examine([MAP], record(RIG, focal=300.0)).warnings == []


@pytest.mark.parametrize(
    ("baseline", "distance", "cause"),
    [(0.0062, 0.07, "metres"), (6200, 70000, "micrometres"), (0.62, 4.0, "metres"),
     (6.2, 70, None), (1.0, 8.0, None), (674, 2300, None)],
)  # fmt: skip
def test_working_distance(baseline: float, distance: float, cause: str | None):
    """Oracle: an endoscope, a microendoscope and a room in mm pass; other units do not."""
    found = working_distance(baseline, distance, record(RIG))
    assert [f"given in {cause}?" in f.what for f in found] == ([True] if cause else [])


def test_no_scale_no_distance():
    """Oracle: the contract; without a given scale there is nothing that can be wrong."""
    rig = record(RIG).model_copy(update={"scale": type(record(RIG).scale)()})
    assert working_distance(1.0, 0.01, rig) == []


def test_findings_explain_a_later_failure():
    """Oracle: the contract; an error inside is given the findings, and stays as it is without."""
    examined = examine([MAP], record(RIG, focal=8.0))
    told = r"no pose; look; a likely cause: projector\.focal: 8 px"
    with pytest.raises(InputError, match=told), examined.told_on_failure():
        raise InputError("no pose", todo="look")
    with pytest.raises(InputError, match=r"^no pose; look\.$"), Examined([], []).told_on_failure():
        raise InputError("no pose", todo="look")
