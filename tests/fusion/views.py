"""Range images of planes and spheres in closed form, and what is true of any good mesh."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.fusion import FusedMesh, RangeFrame
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.transforms import RigidTransform

Floats = NDArray[np.float64]
Surface = Callable[[Floats, Floats], Floats]
"""Range from an origin (3,) along unit directions (H, W, 3), world; NaN = miss."""


def plane(normal: tuple[float, float, float], offset: float) -> Surface:
    """The plane n . X = offset with a unit normal."""
    n = np.array(normal)

    def hit(origin: Floats, ways: Floats) -> Floats:
        s = (offset - origin @ n) / (ways @ n)
        return np.where(s > 0, s, np.nan)

    return hit


def hollow(centre: tuple[float, float, float], radius: float) -> Surface:
    """A sphere around the camera."""
    c = np.array(centre)

    def hit(origin: Floats, ways: Floats) -> Floats:
        along = ways @ (c - origin)
        return along + np.sqrt(along**2 - (c - origin) @ (c - origin) + radius**2)

    return hit


def look(surface: Surface, camera: CameraModel, pose: RigidTransform) -> RangeFrame:
    return RangeFrame(surface(pose.t, pose.rotate(camera.grid_rays)), camera, pose)


def noisy(frame: RangeFrame, share: float, rng: np.random.Generator) -> RangeFrame:
    """Add white noise that grows with the squared range, mm = share * range^2."""
    noise = share * frame.range**2 * rng.standard_normal(frame.range.shape)
    return RangeFrame(frame.range + noise, frame.camera, frame.world_from_camera)


def edge_counts(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many edges have 0, 1, 2, ... faces."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.bincount(np.unique(ends, axis=0, return_counts=True)[1])


def check_clean(mesh: FusedMesh) -> None:
    """Assert what a solver needs of any mesh, by means of its own."""
    faces, count = mesh.faces, len(mesh.vertices)
    assert np.array_equal(np.unique(faces), np.arange(count)), "a vertex is not used"
    assert len(edge_counts(faces)) <= 3, "an edge has three faces"
    ordered = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(np.unique(ordered, axis=0)) == len(ordered), "two faces turn opposite ways"
    assert len(np.unique(np.sort(faces, axis=1), axis=0)) == len(faces), "a face is there twice"
    a, b, c = (mesh.vertices[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    assert area.min() > 1e-7 * np.median(area), "a face has no area"
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1)
    # One fan a vertex: its faces less its inner edges are 0 (closed) or 1 (at the border).
    inner = np.bincount(np.unique(np.sort(ordered, axis=1), axis=0).ravel(), minlength=count)
    fan = inner - np.bincount(faces.ravel(), minlength=count)
    assert set(np.unique(fan)) <= {0, 1}, "fans touch in a vertex"


def face_normals(mesh: FusedMesh) -> tuple[Floats, Floats]:
    """Return the faces' unit normals and middles."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True), (a + b + c) / 3
