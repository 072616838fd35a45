"""A sequence as its frames come: map, way of the camera, lost frames."""

from time import monotonic
from typing import Any

import numpy as np

from ...fusion import FusedMesh, surface_of
from ...geometry.projection_models import ProjectorModel
from ...records.rig import Rig
from ...records.trajectory import FrameRow
from ...sequence.run import Run
from ..colours import CAMERA, PROJECTOR
from ..frame_poses import REACH, camera_corners, pattern_corners, pyramid
from .nodes import Nodes, listed, rgb_bytes, said, small
from .viser_scene import COARSE, light, look_from

VERTICES = 15_000
"""Of the mesh shown. Chosen: a browser takes them within a moment."""
SHARE = 15.0
"""Meshing takes at most one part in so many of the time."""
NAMED = 8
"""Lost frames that are named, the newest."""


class LiveSequence:
    """Shows a run on a server of :func:`running_server`, as a keeper that saves nothing."""

    def __init__(self, server: Any, rig: Rig) -> None:
        self.server, self._rig = server, rig
        self.nodes = Nodes(server)
        light(server)
        self._state = server.gui.add_html(said("Calibrating the first frames", bold=True))
        self._told = server.gui.add_html(small("Blue: camera and its way; orange: projector."))
        self._lost = server.gui.add_html("")
        self._next = 0.0
        self._mesh: tuple[tuple[int, int], FusedMesh] | None = None
        """Parts so far and frames fused into the last, and its mesh then."""

    def after_frame(self, run: Run) -> None:
        """Draw what there is."""
        recorded = run.recorded
        if not recorded.parts:
            return
        self._mesh_again(run)
        part, number = recorded.parts[-1], len(recorded.parts)
        placed = [row for row in recorded.rows if not row.lost and row.part == number - 1]
        with self.nodes.drawing():
            self._surface()
            self._way(placed, part.setup.projector)
        lost = [row for row in recorded.rows if row.lost]
        self._state.content = said(f"Frame {len(recorded.rows)}", bold=True)
        self._told.content = small(f"{len(lost)} frames lost; part {number} of the map.")
        self._lost.content = listed([f"{row.name}: {row.lost}" for row in lost[-NAMED:]])

    def at_end(self, run: Run) -> None:
        """Draw the last state."""
        self._next = 0.0
        self.after_frame(run)

    def end(self, words: str) -> None:
        """Say how the sequence ended."""
        self._state.content = said(words, bold=True)

    def _mesh_again(self, run: Run) -> None:
        """Mesh the map if it has grown, and not too often."""
        part, began = run.recorded.parts[-1], monotonic()
        key = len(run.recorded.parts), part.fused
        if began < self._next or (self._mesh is not None and self._mesh[0] == key):
            return
        try:
            mesh = surface_of(part.volume, vertices=VERTICES)
        except ValueError:  # no two pixels beside each other
            return
        if self._mesh is None:
            look_from(self.server, mesh.vertices)
        self._mesh = key, mesh
        self._next = monotonic() + SHARE * (monotonic() - began)

    def _surface(self) -> None:
        if self._mesh is None:
            return
        key, mesh = self._mesh
        self.nodes.put(
            "/sequence/surface", key,
            lambda name: self.server.scene.add_mesh_simple(
                name, mesh.vertices, mesh.faces, color=rgb_bytes(COARSE), side="double",
                cast_shadow=False, receive_shadow=False,
            ),
        )  # fmt: skip

    def _way(self, placed: list[FrameRow], projector: ProjectorModel) -> None:
        """Draw the camera's way, and where camera and projector are now."""
        centres = np.array([r.world_from_camera.t for r in placed if r.world_from_camera])
        if len(centres) > 1:
            lines = np.stack([centres[:-1], centres[1:]], 1)
            self.nodes.put_lines("/sequence/way", lines, CAMERA)
        if not placed or self._mesh is None:
            return
        now = placed[-1]
        reach = REACH * float(np.median(np.linalg.norm(self._mesh[1].vertices, axis=1)))
        size = self._rig.projector.width, self._rig.projector.height
        for kind, pose, directions, colour in (
            ("camera", now.world_from_camera, camera_corners(self._rig.camera.to_model()), CAMERA),
            ("projector", now.world_from_projector, pattern_corners(projector, size), PROJECTOR),
        ):
            if pose is not None:
                lines = pyramid(pose, directions, reach)
                self.nodes.put_lines(f"/sequence/{kind}", lines, colour)
