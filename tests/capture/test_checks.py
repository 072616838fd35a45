"""Every mistake has its own sentence."""

import numpy as np
import pytest

from mitsuba_endo.capture.checks import check_mesh, check_pattern, check_view
from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes import make_shape
from mitsuba_endo.shapes.mesh import Mesh


def test_every_shape_passes() -> None:
    """Oracle: the package's own surfaces are right."""
    for name in ("colon", "stomach", "rabbit", "plane", "box_planes"):
        check_mesh(make_shape(name))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda v, f: (v / 1000, f), "metres"),
        (lambda v, f: (v * 1000, f), "millimetres"),
        (lambda v, f: (v * np.nan, f), "finite"),
        (lambda v, f: (v, f + 10), "do not exist"),
        (lambda v, f: (v[:0], f[:0]), "no triangles"),
        (lambda v, f: (v, np.where(np.arange(len(f))[:, None] % 2, f, f[:, ::-1])), "wound"),
    ],
)
def test_mistaken_meshes(change, words: str) -> None:
    """Oracle: the error's words; the place is named."""
    mesh = make_shape("bumpy_sheet")
    with pytest.raises(InputError, match=rf"(?s)wall\.ply.*{words}"):
        check_mesh(Mesh(*change(mesh.vertices, mesh.faces)), "wall.ply")


@pytest.mark.parametrize(
    ("pattern", "words"),
    [(np.ones((4, 5)), "4 x 5"), (np.zeros((4, 5, 3)), "black"), (-np.ones((4, 5, 3)), "negative")],
)
def test_mistaken_patterns(pattern: np.ndarray, words: str) -> None:
    """Oracle: the error's words."""
    with pytest.raises(InputError, match=words):
        check_pattern(pattern)


def test_views() -> None:
    """Oracle: some backs of faces, at a mesh's rim, are no mistake."""
    check_view(0.5, 0.1)
    with pytest.raises(InputError, match="sees nothing"):
        check_view(0.0, 0.0)
    with pytest.raises(InputError, match="80 %"):
        check_view(0.9, 0.8)
