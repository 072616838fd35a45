"""Sharp edges stay sharp, smooth surfaces stay whole."""

import numpy as np

from mitsuba_endo.capture.creases import with_creases
from mitsuba_endo.shapes import make_shape


def test_a_box_is_flat_up_to_its_edges() -> None:
    """Oracle: after splitting, the mean normal at every corner is that of its face."""
    mesh = make_shape("box_planes")
    vertices, faces = with_creases(mesh)
    np.testing.assert_array_equal(vertices[faces], mesh.vertices[mesh.faces])
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    mean = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(mean, faces[:, corner], normal)
    length = [np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-30) for x in (normal, mean)]
    unit, mean = normal / length[0], mean / length[1]  # a vertex may be left without faces
    cosine = np.einsum("fi,fci->fc", unit, mean[faces])
    assert cosine.min() > 0.999
    assert len(vertices) > len(mesh.vertices)


def test_a_sheet_is_left_alone() -> None:
    """Oracle: not one vertex is added to a surface without edges."""
    mesh = make_shape("bumpy_sheet")
    vertices, faces = with_creases(mesh)
    assert len(vertices) == len(mesh.vertices)
    np.testing.assert_array_equal(faces, mesh.faces)
