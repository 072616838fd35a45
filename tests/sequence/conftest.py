"""A short withdrawal through a colon, tracked once for all tests that look at it."""

from collections.abc import Iterator

import pytest

from mitsuba_endo import backend
from mitsuba_endo.sequence.frames import Incoming, Unread
from mitsuba_endo.sequence.outcome import SequenceResult, outcome_of
from mitsuba_endo.sequence.run import Recorded, run_sequence
from tests.sequences import Recording, withdrawal

COUNT = 26
NOTHING = (22, 23)
"""Frames of which nothing is decoded."""


@pytest.fixture(scope="session")
def colon() -> Recording:
    return withdrawal(COUNT)


def frames(recording: Recording) -> Iterator[Incoming]:
    """The maps, without those of :data:`NOTHING`."""
    for k in range(len(recording)):
        yield Unread(f"frame{k:04d}", "blood") if k in NOTHING else recording.map(k)


@pytest.fixture(scope="session")
def recorded(colon: Recording) -> Recorded:
    backend.use("llvm_ad_rgb")
    return run_sequence(frames(colon), colon.rig())


@pytest.fixture(scope="session")
def result(recorded: Recorded) -> SequenceResult:
    return outcome_of(recorded)
