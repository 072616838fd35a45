"""The rig file that a user with a calibrated camera would write for a synthetic scene."""

from pathlib import Path

import numpy as np
import yaml

from ..files import atomic_path
from .ground_truth import GroundTruth
from .rig import Camera, Focal, Projector, Rig, Scale


def known_rig(truth: GroundTruth) -> Rig:
    """Return what is known before a calibration, from the truth of a synthetic scene.

    Known are the camera's intrinsics and, of the projector, law, pattern size, centre, aspect and
    distortion; of the scale, the first frame's baseline. Left out is what is to be found: focal
    length and poses.
    """
    at, (width, height) = truth.first, truth.pattern_size
    return Rig(
        camera=Camera.from_model(at.camera),
        projector=Projector(
            law=at.projector.law,
            width=width,
            height=height,
            focal=Focal(refine=True),
            centre=[float(c) for c in at.projector.centre],
            aspect=float(at.projector.aspect),
            distortion=[float(k) for k in at.projector.distortion.coefficients],
        ),
        scale=Scale(baseline=float(np.linalg.norm(at.projector_from_camera.t))),
    )


def save_rig(path: str | Path, rig: Rig) -> None:
    """Write ``rig.yaml`` with what was said in ``rig``; the rest keeps its defaults.

    Raises:
        InputError: the file cannot be written.
    """
    data = rig.model_dump(mode="json", exclude_unset=True)
    with atomic_path(path) as aside:
        text = yaml.safe_dump(
            {"units": rig.units, **data}, sort_keys=False, default_flow_style=None, width=100
        )
        aside.write_text(text, encoding="utf-8")
