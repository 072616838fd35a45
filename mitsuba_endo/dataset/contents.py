"""What is stored of a sample, under the names it has in every format."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .sample import Sample

Arrays = dict[str, NDArray[Any]]

IMAGE, RADIANCE, Q, PHASE, NODE, CODE = "image", "radiance", "q", "phase", "node", "code"
DEPTH, NORMALS, VERTICES, FACES = "depth", "normals", "vertices", "faces"
MASKS = ("visible", "shadow", "camera", "mixed")


def arrays_of(sample: Sample, radiance: bool, surface: bool) -> Arrays:
    """Return a sample's arrays by name; see :class:`~.truth.TruthMaps` for their meaning.

    Args:
        sample: the sample.
        radiance: whether to keep the linear image, float16.
        surface: whether to keep the mesh: ``vertices`` (mm, camera frame) and ``faces``.
    """
    maps = sample.maps
    arrays: Arrays = {
        IMAGE: sample.image, Q: maps.q, PHASE: maps.phase, NODE: maps.node, CODE: maps.code,
        DEPTH: maps.depth, NORMALS: maps.normals,
        **{name: getattr(maps, name) for name in MASKS},
    }  # fmt: skip
    if radiance:
        arrays[RADIANCE] = sample.radiance
    if surface:
        arrays[VERTICES] = sample.mesh.vertices.astype(np.float32)
        arrays[FACES] = sample.mesh.faces.astype(np.uint32)
    return arrays
