"""An optimisation as it runs."""

from typing import Any

import numpy as np

from ...geometry.projection_models import PROJECTION_MODELS, projector_model
from ...records.calibration import Snapshot
from ...records.rig import Rig
from ..colours import CAMERA, PROJECTOR
from ..frame_poses import REACH, camera_corners, pattern_corners, pyramid
from .controls import snapshot_words
from .cost_chart import add_cost_chart, chart_data
from .nodes import Nodes, said, small
from .viser_scene import light, look_from, put_snapshot_surface, snapshot_poses


class LiveView:
    """Shows snapshots on a server of :func:`running_server` as they come; see :meth:`show`."""

    def __init__(self, server: Any, rig: Rig) -> None:
        self.server, self._rig = server, rig
        self.nodes = Nodes(server)
        self.history: list[Snapshot] = []
        light(server)
        self._state = server.gui.add_html(said("Searching for a start", bold=True))
        self._told = server.gui.add_html(small("Lengths are multiples of the first baseline."))
        server.gui.add_html(small("Blue: camera; orange: projector."))
        self._chart: Any = None

    def show(self, snapshot: Snapshot) -> None:
        """Draw a snapshot; one that is a start begins a new history."""
        if snapshot.iteration == 0:
            self.history.clear()
            look_from(self.server, snapshot.surfaces[0])
            self._turn_clients()
        self.history.append(snapshot)
        with self.nodes.drawing():
            for s in range(len(snapshot.surfaces)):
                put_snapshot_surface(self.nodes, snapshot, s)
            for k in range(len(snapshot.world_from_camera)):
                self._frusta(snapshot, k)
        self._state.content = said("Optimising", bold=True)
        self._told.content = small(snapshot_words(snapshot))
        if self._chart is None:
            self._chart = add_cost_chart(self.server, self.history)
        self._chart.data = chart_data(self.history, len(self.history) - 1)

    def end(self, words: str) -> None:
        """Say how the optimisation ended."""
        self._state.content = said(words, bold=True)

    def _frusta(self, snapshot: Snapshot, frame: int) -> None:
        at, projector = snapshot_poses(snapshot, frame), self._rig.projector
        reach = REACH * float(np.median(np.linalg.norm(snapshot.surfaces[0], axis=-1)))
        law = projector.law if projector.law in PROJECTION_MODELS else next(iter(PROJECTION_MODELS))
        size = projector.width, projector.height
        centre = [(n - 1) / 2 for n in size]
        corners = {
            "camera": (at.first_from_camera, camera_corners(self._rig.camera.to_model())),
            "projector": (
                at.first_from_projector,
                pattern_corners(projector_model(law, snapshot.focal[frame], centre), size),
            ),
        }
        for (kind, (pose, directions)), colour in zip(
            corners.items(), (CAMERA, PROJECTOR), strict=True
        ):
            assert pose is not None  # a snapshot knows every pose
            lines = pyramid(pose, directions, reach)
            self.nodes.put_lines(f"/iteration/frame_{frame}/{kind}", lines, colour)

    def _turn_clients(self) -> None:
        """Let browsers that were there before the start look at it too."""
        for client in self.server.get_clients().values():
            with client.atomic():
                client.camera.look_at = self.server.initial_camera.look_at
                client.camera.position = self.server.initial_camera.position
                client.camera.up_direction = (0.0, -1.0, 0.0)
