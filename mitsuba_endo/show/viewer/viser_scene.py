"""The 3D scene: nodes of viser for what is chosen, in the frame of the first camera."""

from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from ...geometry.transforms import RigidTransform
from ...records.calibration import Snapshot, SurfaceEstimate
from ..colours import CAMERA, MISSING, PROJECTOR
from ..frame_poses import Floats, FramePoses, camera_corners, pyramid, solution_corners
from ..result_scene import ResultScene
from ..surface_colours import Shown
from .choice import Choice
from .nodes import Nodes, rgb_bytes

TRUTH = "#3a3a3a"
COARSE = "#9fb4c4"
_TEXELS = 256
"""Colours of a scale. Chosen: as many as a channel of 8 bits has levels."""


class ViserScene:
    """Draws a scene on a viser server; nodes that do not change stay."""

    def __init__(self, server: Any, scene: ResultScene) -> None:
        self.server, self.scene = server, scene
        self.nodes = Nodes(server)
        light(server)
        look_from(server, scene.calibration.surface.vertices)

    def draw(self, choice: Choice) -> None:
        """Show what is chosen and nothing else."""
        with self.nodes.drawing():
            if choice.snapshot is None:
                self._result(choice)
            else:
                self._snapshot(self.scene.calibration.history[choice.snapshot], choice)
            if choice.truth:
                self._truth(choice)

    def shown_surfaces(self, choice: Choice) -> list[int]:
        """Return the indices of the surfaces that are shown."""
        if len(self.scene.surfaces) == 1:
            return [0]
        return [choice.frame] if choice.frame is not None else list(range(len(self.scene.surfaces)))

    def _result(self, choice: Choice) -> None:
        scene = self.scene
        if choice.surface:
            quantities = scene.quantities()
            shown = next((q for q in quantities if q.name == choice.colour), quantities[0])
            for k in self.shown_surfaces(choice):
                self.nodes.put(
                    f"/surface/{k}", shown.name, lambda name, k=k: self._mesh(name, k, shown)
                )
        for k in self._frames(choice):
            if choice.frusta:
                self._frusta(f"/frame_{k}", k, scene.poses[k])
            if choice.rays:
                self._rays(k)

    def _snapshot(self, snapshot: Snapshot, choice: Choice) -> None:
        several = len(snapshot.surfaces) > 1
        if choice.surface:
            for s in self.shown_surfaces(choice) if several else [0]:
                put_snapshot_surface(self.nodes, snapshot, s)
        if choice.frusta:
            for k in self._frames(choice):
                self._frusta(f"/iteration/frame_{k}", k, snapshot_poses(snapshot, k))

    def _truth(self, choice: Choice) -> None:
        truth = self.scene.truth
        if truth is None:
            return
        viser, surface = self.server.scene, truth.surface
        if surface is not None:
            self.nodes.put(
                "/truth/surface", 0,
                lambda name: viser.add_mesh_simple(
                    name, surface.vertices, surface.faces, color=rgb_bytes(TRUTH), opacity=0.25,
                    side="double",
                ),
            )  # fmt: skip
        if choice.frusta:
            for k in self._frames(choice):
                self._frusta(f"/truth/frame_{k}", k, truth.poses[k], TRUTH)

    def _frames(self, choice: Choice) -> list[int]:
        return list(range(len(self.scene.poses))) if choice.frame is None else [choice.frame]

    def _mesh(self, name: str, surface: int, shown: Shown) -> Any:
        mesh = coloured_mesh(self.scene.surfaces[surface], shown, surface)
        pose = self.scene.first_from_surface(surface)
        return self.server.scene.add_mesh_trimesh(
            name, mesh, wxyz=quaternion(pose), position=pose.t, cast_shadow=False,
            receive_shadow=False,
        )  # fmt: skip

    def _frusta(self, prefix: str, frame: int, at: FramePoses, colour: str | None = None) -> None:
        solution, camera = self.scene.calibration.solution, self.scene.calibration.camera
        for kind, pose, own, corners in (
            ("camera", at.first_from_camera, CAMERA, camera_corners(camera)),
            (
                "projector", at.first_from_projector, PROJECTOR,
                solution_corners(solution, solution.frames[frame]),
            ),
        ):  # fmt: skip
            if pose is None:
                continue
            lines = pyramid(pose, corners, self.scene.reach)
            self.nodes.put_lines(f"{prefix}/{kind}", lines, colour or own)
            if colour is None:
                several = len(self.scene.poses) > 1
                words = f"{kind}, {at.name}" if several else kind
                self._label(f"{prefix}/{kind}_name", words, pose)

    def _label(self, name: str, text: str, pose: RigidTransform) -> None:
        below = pose.apply(np.array([0.0, 0.02, -0.02]) * self.scene.distance)
        self.nodes.put(
            name, below.tobytes(),
            lambda name: self.server.scene.add_label(
                name, text, position=below, anchor="top-center", font_screen_scale=0.8
            ),
        )  # fmt: skip

    def _rays(self, frame: int) -> None:
        rays = self.scene.rays(frame)
        if rays is None:
            return
        for kind, lines, colour in (
            ("camera", rays.camera, CAMERA), ("projector", rays.projector, PROJECTOR),
        ):  # fmt: skip
            self.nodes.put_lines(f"/rays_{frame}/{kind}", lines, colour, 1.0)


def snapshot_poses(snapshot: Snapshot, frame: int) -> FramePoses:
    """Return where a frame's camera and projector stood."""
    first = snapshot.world_from_camera[0].inverse() @ snapshot.world_from_camera[frame]
    return FramePoses("", first, first @ snapshot.projector_from_camera[frame].inverse())


def coloured_mesh(surface: SurfaceEstimate, shown: Shown, index: int) -> trimesh.Trimesh:
    """Return a surface with colours by a texture that is the scale itself.

    With colours per vertex a viewer interpolates between colours, which need not lie on the
    scale, and the format knows no dull material for them. The last texel stands for unknown.
    """
    from PIL import Image
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    texels = np.concatenate([shown.strip(_TEXELS), [rgb_bytes(MISSING)]]).astype(np.uint8)
    share = shown.share(index)
    texel = np.where(np.isfinite(share), share * (_TEXELS - 1), _TEXELS)
    uv = np.stack([(texel + 0.5) / (_TEXELS + 1), np.full(len(texel), 0.5)], -1)
    material = PBRMaterial(
        baseColorTexture=Image.fromarray(texels[None]), metallicFactor=0.0, roughnessFactor=1.0,
        doubleSided=True,
    )  # fmt: skip
    visual = TextureVisuals(uv=uv, material=material)
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False, visual=visual)
    mesh.vertex_normals  # noqa: B018 - computed here, or the export leaves them out
    return mesh


def put_snapshot_surface(nodes: Nodes, snapshot: Snapshot, index: int) -> None:
    """Want the coarse surface of a snapshot shown."""
    vertices, faces = snapshot.surfaces[index], snapshot.faces[index]
    pose = RigidTransform.identity()
    if len(snapshot.surfaces) > 1:
        pose = snapshot_poses(snapshot, index).first_from_camera or pose
    nodes.put(
        f"/iteration/surface_{index}", (snapshot.iteration, vertices.tobytes()),
        lambda name: nodes.server.scene.add_mesh_simple(
            name, vertices, faces, color=rgb_bytes(COARSE), side="double",
            wxyz=quaternion(pose), position=pose.t, cast_shadow=False, receive_shadow=False,
        ),
    )  # fmt: skip


def look_from(server: Any, vertices: Floats) -> None:
    """Look at a surface from beside its camera, as the camera is held."""
    centre = np.median(vertices, axis=0)
    distance = float(np.linalg.norm(centre))
    server.scene.set_up_direction("-y")
    server.initial_camera.look_at = 0.75 * centre
    server.initial_camera.position = 0.75 * centre + distance * np.array([-0.95, -0.6, -0.95])
    server.initial_camera.near = 1e-3 * distance
    server.initial_camera.far = 1e3 * distance


def light(server: Any) -> None:
    """Light that leaves the scale's colours as they are in its legend, with some relief."""
    scene = server.scene
    scene.configure_default_lights(False)
    scene.configure_environment_map(None)
    scene.add_light_ambient("/light/ambient", intensity=1.7)
    scene.add_light_directional("/light/key", intensity=1.4, position=(-0.6, -0.8, -1.0))


def quaternion(pose: RigidTransform) -> Floats:
    """Return a rotation as (w, x, y, z)."""
    x, y, z, w = Rotation.from_matrix(pose.R).as_quat()
    return np.array([w, x, y, z])
