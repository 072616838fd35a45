"""What a user gives of the synthetic rigs of :mod:`tests.rigs`, to be spoilt by the tests."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import Camera, Rig
from tests import rigs


def map_of(q: NDArray, name: str = "map.exr") -> CorrespondenceMap:
    return CorrespondenceMap(np.asarray(q, np.float32), name)


def record(rig: rigs.Rig, **projector: object) -> Rig:
    """Return the rig file of a synthetic rig, with entries of its projector replaced."""
    data = {
        "camera": Camera.from_model(rig.camera),
        "projector": {
            "law": rig.projector.law, "width": rig.size[0], "height": rig.size[1],
            "centre": [float(c) for c in rig.projector.centre],
            "aspect": float(rig.projector.aspect), **projector,
        },
        "scale": {"baseline": rig.baseline},
    }  # fmt: skip
    return Rig.model_validate(data)


def with_camera(rig: Rig, **changes: object) -> Rig:
    """Return the rig with entries of its camera replaced."""
    camera = Camera.model_validate({**rig.camera.model_dump(), **changes})
    return rig.model_copy(update={"camera": camera})


def scaled_K(rig: Rig, factor: float, centre: float | None = None) -> list[list[float]]:
    """Return K with focal lengths times a factor, and the centre likewise or times another."""
    K = np.array(rig.camera.K)
    K[[0, 1], [0, 1]] *= factor
    K[:2, 2] = (K[:2, 2] + 0.5) * (factor if centre is None else centre) - 0.5
    return K.tolist()


def noisy(seed: int, **kind: str) -> rigs.Rig:
    """Return a rig whose map has 1 px of noise, 30 % of outliers, and slips in every fourth."""
    camera = (rigs.lopsided_fisheye if seed % 3 == 0 else rigs.lopsided_camera)(160, 112)
    rig = rigs.with_noise(rigs.random_rig(seed, camera, **kind), 1.0, seed)
    rig = rigs.with_outliers(rig, 0.3, seed)
    return rigs.with_slips(rig, 0.2, 12, seed) if seed % 4 == 1 else rig


def thinned(rig: rigs.Rig, step: int) -> rigs.Rig:
    """Keep every ``step``-th pixel of every ``step``-th row."""
    q = np.full_like(rig.q, np.nan)
    q[::step, ::step] = rig.q[::step, ::step]
    return replace(rig, q=q)
