"""What a photograph cannot be made of: meshes and views that are mistakes."""

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..shapes.mesh import Mesh

SMALLEST, LARGEST = 1.0, 3000.0
"""Sizes of a believable surface (diagonal of its box), mm: others are mistaken units."""
CONFLICTS = 0.01
"""Share of edges along which neighbouring faces may be wound against each other."""
FROM_BEHIND = 0.5
"""Share of what is seen that may be seen from behind."""


def check_mesh(mesh: Mesh, source: str = "mesh") -> None:
    """Refuse a mesh that is empty, broken, of an unbelievable size or wound at random.

    Raises:
        InputError: says which, with ``source`` as the place.
    """
    if not len(mesh.vertices) or not len(mesh.faces):
        raise InputError("the mesh has no triangles", source, "give a mesh with vertices and faces")
    if not np.isfinite(mesh.vertices).all():
        raise InputError("some vertices are not finite", source, "mend or remove them")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise InputError("some faces name vertices that do not exist", source, "mend its faces")
    size = float(np.linalg.norm(np.diff(mesh.bounds, axis=0)))
    if not SMALLEST <= size <= LARGEST:
        metres = SMALLEST <= 1000 * size <= LARGEST
        raise InputError(
            f"the mesh is {size:.3g} mm large" + (", as if its units were metres" * metres),
            source, "give it in millimetres" + (": multiply it by 1000" * metres),
        )  # fmt: skip
    check_winding(mesh, source)


def check_winding(mesh: Mesh, source: str) -> None:
    """Refuse faces wound at random; a few edges with three faces do no harm.

    Raises:
        InputError: more than 1 % of the edges join faces wound against each other.
    """
    i, j = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    directed = np.sort(i * len(mesh.vertices) + j)
    conflicts = float((np.diff(directed) == 0).sum() / len(i))
    if conflicts > CONFLICTS:
        raise InputError(
            f"{100 * conflicts:.0f} % of the edges join faces that are wound against each other",
            source, "orient its faces alike",
        )  # fmt: skip


def check_pattern(pattern: NDArray[np.floating]) -> None:
    """Refuse what is no linear RGB image (H, W, 3) with some light.

    Raises:
        InputError: another shape, negative or not finite values, or black.
    """
    if pattern.ndim != 3 or pattern.shape[2] != 3 or min(pattern.shape[:2]) < 2:
        shape = " x ".join(map(str, pattern.shape))
        raise InputError(f"is {shape}", "pattern", "give linear RGB, height x width x 3")
    if not np.isfinite(pattern).all() or pattern.min() < 0:
        raise InputError("has negative or missing values", "pattern", "give linear light from 0 on")
    if not pattern.max() > 0:
        raise InputError("is black", "pattern", "give a pattern with some light")


def check_view(hit: float, from_behind: float) -> None:
    """Refuse a camera that sees nothing, or tissue from its inner side.

    Args:
        hit: share of the pixels that see the mesh.
        from_behind: share of those that see faces pointing away.

    Raises:
        InputError: one of the two.
    """
    if hit == 0:
        raise InputError(
            "the camera sees nothing of the mesh", "world_from_camera",
            "check the pose, in mm, and that the mesh is before the camera",
        )  # fmt: skip
    if from_behind > FROM_BEHIND:
        raise InputError(
            f"{100 * from_behind:.0f} % of what the camera sees are backs of faces",
            "world_from_camera",
            "move the camera out of the wall, or turn the mesh's faces to the camera's side",
        )
