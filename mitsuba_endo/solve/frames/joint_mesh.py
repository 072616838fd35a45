"""The problem of several frames that share one triangle mesh, fused from what each saw alone.

A lattice around the first camera holds one range for each direction. Where later frames look behind
folds, or where the camera travels, one mesh in the world holds what all of them see.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...fusion import RangeFrame, Volume, surface_of
from ...fusion.clean import areas
from ...fusion.fuse import vertex_normals
from ...fusion.remesh import remesh
from ...geometry.cameras import CameraModel
from ...initialisation.registration import Registration
from ...records.rig import Rig
from ..costs.objective import Problem, make_problem
from ..costs.registry import priors_of
from ..costs.smoothness import prior_weight, smoothness
from ..inference.fit import FrameSolution
from ..surfaces.triangle_mesh import triangle_mesh
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .edge_lengths import edge_lengths
from .joint import disparity_of, registered_values

Floats = NDArray[np.float64]

MAX_VERTICES = 20_000
"""Of the mesh: a banded factorisation takes 0.1 s then, and four times that at 40,000."""
_AREA = np.sqrt(3) / 2
"""Area of the surface per vertex over the square of the edges' length: equilateral triangles."""
_VOXEL = 0.35
"""Side of a voxel over the spacing of the frames' own surfaces: finer than the shortest edges."""


def joint_mesh_problem(
    frames: Sequence[FrameSolution],
    registered: Sequence[Registration],
    camera: CameraModel,
    rig: Rig,
    layout: Layout,
    law: str,
) -> tuple[Problem, State]:
    """Build the joint problem of frames that were registered, on a mesh; the first is the world.

    Args:
        frames: the frames solved alone, with their range images.
        registered: where each is, in units of the first one's baseline.
        camera: which saw them.
        rig: what is known.
        layout: of the unknowns.
        law: name of the projector's projection model.
    """
    views = [
        RangeFrame(registration.scale * frame.range, camera, registration.world_from_camera)
        for frame, registration in zip(frames, registered, strict=True)
        if frame.range is not None
    ]
    values = registered_values(frames, registered)
    disparity = disparity_of(layout.state([np.zeros(1)], values))
    vertices, faces = _fused(views, frames, _VOXEL * _spacing(frames, registered), disparity)
    directions, distances = vertex_normals(vertices, faces), _distances(vertices, views)
    mesh, _ = triangle_mesh(vertices, faces, directions, distances)
    state = layout.state([np.zeros(mesh.size)], values)
    weight = prior_weight(mesh, sum(f.observations.count for f in frames))
    terms = [smoothness(mesh, 0, weight, disparity), *priors_of(rig, layout)]
    observed = [f.observations for f in frames]
    return make_problem(observed, [mesh], state, layout, law, terms), state


def _spacing(frames: Sequence[FrameSolution], registered: Sequence[Registration]) -> float:
    """Return the spacing of the frames' own surfaces, baselines of the first frame."""
    sizes = [
        registration.scale * frame.cell * float(np.median(np.linalg.norm(frame.points, axis=1)))
        for frame, registration in zip(frames, registered, strict=True)
    ]
    return float(np.median(sizes))


def _fused(
    views: Sequence[RangeFrame], frames: Sequence[FrameSolution], voxel: float, disparity: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Return vertices and faces of what frames see, as fine as it needs and the limit allows."""
    volume = Volume(voxel)
    for view in views:
        volume.integrate(view)
    fine = surface_of(volume)
    edge = edge_lengths(fine, frames, _distances(fine.vertices, views), disparity)
    of_faces = edge[fine.faces].mean(1)
    count = float(np.sum(areas(fine.vertices, fine.faces) / (_AREA * of_faces**2)))
    return remesh(fine.vertices, fine.faces, edge * np.sqrt(max(count / MAX_VERTICES, 1.0)))


def _distances(vertices: Floats, views: Sequence[RangeFrame]) -> Floats:
    """Return how far (V,) the nearest camera is from every vertex."""
    all_ = np.array([np.linalg.norm(vertices - v.world_from_camera.t, axis=1) for v in views])
    return all_.min(0)
