"""The rig file that a user with a calibrated camera would write for a synthetic scene."""

from pathlib import Path

import numpy as np
import yaml

from ..files import atomic_path
from .rig import Focal, Projector, Rig, Scale
from .solution import Solution


def known_rig(truth: Solution) -> Rig:
    """Return what is known before a calibration, from the truth of a synthetic scene.

    Known are the camera's intrinsics and, of the projector, law, pattern size, centre, aspect and
    distortion; of the scale, the first frame's baseline. Left out is what is to be found: focal
    length and poses.
    """
    projector = truth.projector
    pose = truth.frames[0].projector_from_camera.to_transform()
    model = projector.to_model()
    if truth.camera is None or model is None or pose is None:
        raise ValueError("a truth has a camera, a projector and a pose")
    if projector.width is None or projector.height is None:
        raise ValueError("a truth has the pattern's size")
    return Rig(
        camera=truth.camera,
        projector=Projector(
            law=projector.law,
            width=projector.width,
            height=projector.height,
            focal=Focal(refine=True),
            centre=[float(c) for c in model.centre],
            aspect=float(model.aspect),
            distortion=[float(k) for k in model.distortion.coefficients],
        ),
        scale=Scale(baseline=float(np.linalg.norm(pose.t))),
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
