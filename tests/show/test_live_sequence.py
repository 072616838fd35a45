"""The live view of a sequence: what it puts on its server frame by frame."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")
from mitsuba_endo import backend
from mitsuba_endo.sequence.frames import Incoming, Unread
from mitsuba_endo.sequence.keeper import Keepers
from mitsuba_endo.sequence.options import SequenceOptions
from mitsuba_endo.sequence.run import Run, run_sequence
from mitsuba_endo.show.viewer import LiveSequence, running_server
from mitsuba_endo.show.viewer.nodes import said
from tests.sequences import exact, withdrawal

# viser's own.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
COUNT = 8
PORT = 9471


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    with running_server("localhost", PORT) as running:
        yield running


def test_map_way_and_lost_frames_are_shown(server: Any) -> None:
    """Oracle: the run: cameras' centres, and the reason of the lost frame, as text."""
    backend.use("llvm_ad_rgb")
    clean = withdrawal(COUNT, noise=exact)
    live = LiveSequence(server, clean.rig())
    before: list[list[str]] = []

    class Looks:
        def after_frame(self, run: Run) -> None:
            before.append(live.nodes.visible)

        at_end = after_frame

    def frames() -> Iterator[Incoming]:
        for k in range(COUNT):
            yield Unread("f5", "<b>blood</b>") if k == 5 else clean.map(k)

    options, both = SequenceOptions(first=4), Keepers([Looks(), live])
    recorded = run_sequence(frames(), clean.rig(), options, keeper=both)
    assert before[:4] == [[]] * 4  # nothing is known before the first frames are calibrated
    names = {"/sequence/surface", "/sequence/way", "/sequence/camera", "/sequence/projector"}
    assert set(before[-1]) == names
    way = np.array([r.world_from_camera.t for r in recorded.rows if r.world_from_camera])
    lines = server.scene.get_handle_by_name("/sequence/way").points
    np.testing.assert_allclose(lines[:, 0], way[:-1], atol=1e-5)
    np.testing.assert_allclose(lines[:, 1], way[1:], atol=1e-5)
    mesh = server.scene.get_handle_by_name("/sequence/surface")
    assert len(mesh.vertices) > 1000
    assert "&lt;b&gt;blood&lt;/b&gt;" in live._lost.content
    assert "1 frames lost; part 1 of the map." in live._told.content
    assert live._state.content == said(f"Frame {COUNT}", bold=True)
    live.end("interrupted")
    assert live._state.content == said("interrupted", bold=True)
