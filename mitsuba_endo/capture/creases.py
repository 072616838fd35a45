"""Sharp edges: where shading must not be smooth."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..shapes.mesh import Mesh

SHARP = np.radians(40)
"""Angle between a face and the mean normal at its corner beyond which the corner is flat: a right
angle between two faces has 45 degrees, folds of tissue that a mesh resolves have less."""


@lru_cache(maxsize=1)
def with_creases(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices and faces of the same surface whose corners at sharp edges stand alone.

    Mitsuba smooths normals over the faces that share a vertex; a corner with a vertex of its own
    keeps its face's normal. No position changes. The last mesh's are kept, for the picture and the
    truth: change neither.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)  # its length weighs by area
    mean = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(mean, mesh.faces[:, corner], normal)
    unit, mean = (x / np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-30)
                  for x in (normal, mean))  # fmt: skip
    cosine = np.einsum("fi,fci->fc", unit, mean[mesh.faces])
    sharp = cosine < np.cos(SHARP)
    faces = mesh.faces.copy()
    alone = mesh.faces[sharp]
    faces[sharp] = len(mesh.vertices) + np.arange(len(alone))
    return np.concatenate([mesh.vertices, mesh.vertices[alone]]), faces
