"""The problem of several frames that share one triangle mesh, fused from what each saw alone.

A lattice around the first camera holds one range for each direction. Where later frames look behind
folds, or where the camera travels, one mesh in the world holds what all of them see.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...fusion import FusedMesh, RangeFrame, Volume, surface_of
from ...geometry.cameras import CameraModel
from ...geometry.transforms import RigidTransform
from ...records.rig import Rig
from ...start.registration import Registration
from ..costs.problem import Problem, make_problem
from ..costs.registry import priors_of
from ..costs.smoothness import prior_weight, smoothness
from ..inference.fit import FrameSolution
from ..surfaces.mesh import triangle_mesh
from ..unknowns.layout import Layout
from ..unknowns.state import State
from .joint import disparity_of, registered_values

Floats = NDArray[np.float64]

MAX_VERTICES = 20_000
"""Of the mesh: a banded factorisation takes 0.1 s then, and four times that at 40,000."""
_AREA = np.sqrt(3) / 2
"""Area of the surface per vertex over the square of the edges' length: equilateral triangles."""
_FINER = 0.7
"""Length of the edges over the spacing of the frames' own surfaces: several frames see each place.
In a colon with folds of 3 mm, chords as long as that spacing miss the surface by twice what noise
does."""
_VOXEL = 0.5
"""Side of a voxel over the edges' length: fine enough that decimation chooses the vertices."""


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

    Raises:
        InputError: the frames were not registered.
    """
    if any(frame.range is None for frame in frames):
        raise InputError(
            "a mesh needs frames that were registered", "cameras", "use cameras=registration"
        )
    views = [
        RangeFrame(place.scale * frame.range, camera, place.world_from_camera)
        for frame, place in zip(frames, registered, strict=True)
        if frame.range is not None
    ]
    fused = _fused(views, _spacing(frames, registered))
    distances = _distances(fused.vertices, [v.world_from_camera for v in views])
    mesh, _ = triangle_mesh(fused.vertices, fused.faces, fused.normals, distances)
    state = layout.state([np.zeros(mesh.size)], registered_values(frames, registered))
    weight = prior_weight(mesh, sum(f.observations.count for f in frames))
    terms = [smoothness(mesh, 0, weight, disparity_of(state)), *priors_of(rig, layout)]
    observed = [f.observations for f in frames]
    return make_problem(observed, [mesh], state, layout, law, terms), state


def _spacing(frames: Sequence[FrameSolution], registered: Sequence[Registration]) -> float:
    """Return the length that edges shall have, baselines of the first frame."""
    sizes = [
        place.scale * frame.cell * float(np.median(np.linalg.norm(frame.points, axis=1)))
        for frame, place in zip(frames, registered, strict=True)
    ]
    return _FINER * float(np.median(sizes))


def _fused(views: Sequence[RangeFrame], spacing: float) -> FusedMesh:
    """Return a mesh with edges of about a length, of at most :data:`MAX_VERTICES` vertices."""
    volume = Volume(_VOXEL * spacing)
    for view in views:
        volume.integrate(view)
    fine = surface_of(volume)
    corners = fine.vertices[fine.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = float(np.linalg.norm(normals, axis=1).sum()) / 2
    wanted = min(int(area / (_AREA * spacing**2)), MAX_VERTICES)
    return surface_of(volume, vertices=wanted) if wanted < len(fine.vertices) else fine


def _distances(vertices: Floats, cameras: Sequence[RigidTransform]) -> Floats:
    """Return how far (V,) the nearest camera is from every vertex."""
    all_ = np.array([np.linalg.norm(vertices - pose.t, axis=1) for pose in cameras])
    return all_.min(0)
