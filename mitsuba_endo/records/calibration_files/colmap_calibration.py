"""COLMAP models of cameras and projectors, as ``export --format colmap`` writes them.

The image ``projector/NAME`` is the projector of the frame whose image is ``NAME``. COLMAP has no
unit of length, so what is read is up to scale: in multiples of the first baseline.
"""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...geometry.transforms import RigidTransform
from ...reading.colmap_model import ModelImage, SparseModel, is_model, read_model
from ..camera_files.camera_file import Values
from ..camera_files.document import Document
from ..camera_files.registry import FORMATS
from ..rig_camera import Camera
from ..solution import Estimate, Frame, Outcome, PoseEstimate, ProjectorEstimate, Solution
from ..validation import validate
from .registry import register_calibration_format

PROJECTOR = "projector/"
"""Before the name of a frame's image: that of its projector."""


@register_calibration_format("a COLMAP model of cameras and projectors", is_model)
def read(path: Path) -> Solution:
    """Read poses and intrinsics.

    Raises:
        InputError: no image is a projector's, cameras of frames differ, or damage.
    """
    model = read_model(path)
    projectors = {im.name.removeprefix(PROJECTOR): im for im in model.images if _is_projector(im)}
    cameras = [im for im in model.images if im.name in projectors and not _is_projector(im)]
    if not cameras:
        raise InputError(
            f"no image is called {PROJECTOR}NAME beside an image NAME", str(path),
            "call each frame's projector so, as export --format colmap does",
        )  # fmt: skip
    if len({im.camera for im in cameras}) > 1:
        raise InputError("frames have different cameras", str(path), "give one camera's frames")
    camera = _camera(model, cameras[0].camera, path)
    own = [_camera(model, projectors[im.name].camera, path) for im in cameras]
    return Solution(
        outcome=Outcome.TRUTH, units="baseline", scale="up_to_scale",
        camera=validate(Camera, camera, f"{path}: camera {cameras[0].camera}"),
        projector=_projector(own[0]), frames=_frames(cameras, projectors, own, path),
    )  # fmt: skip


def _is_projector(image: ModelImage) -> bool:
    return image.name.startswith(PROJECTOR)


def _camera(model: SparseModel, number: str, path: Path) -> Values:
    line = model.cameras.get(number)
    if line is None:
        raise InputError(f"camera {number} is missing", str(path), "export the model again")
    form = FORMATS["COLMAP cameras.txt"]
    document = Document(path, line, {})
    if not form.matches(document):
        raise InputError(f"camera {number} is damaged", str(path), "export the model again")
    return form.read(document).camera


def _projector(values: Values) -> ProjectorEstimate:
    (fx, _, cx), (_, fy, cy), _ = values["K"]
    if not (fx > 0 and fy > 0):
        raise InputError("a projector's focal length is not positive", "cameras", "fit it again")
    if any(values["distortion"][5:]):
        raise InputError("a projector has k4 to k6", "cameras", "fit it without")
    distortion = [float(k) for k in values["distortion"][:5]]
    while distortion and distortion[-1] == 0:
        distortion.pop()

    def known(value: float | list[float]) -> Estimate:
        return Estimate(value=value, status="fixed")

    return ProjectorEstimate(
        law="pinhole", width=values["width"], height=values["height"], focal=known(fx),
        centre=known([cx, cy]), aspect=known(fy / fx), distortion=known(distortion),
    )  # fmt: skip


def _frames(
    cameras: list[ModelImage], projectors: dict[str, ModelImage], own: list[Values], path: Path
) -> list[Frame]:
    pairs = [(_pose(im, path), _pose(projectors[im.name], path)) for im in cameras]
    poses = [projector @ camera.inverse() for camera, projector in pairs]
    unit = float(np.linalg.norm(poses[0].t))
    if unit == 0:
        raise InputError("the first baseline is zero", str(path), "give another model")
    first = pairs[0][0]
    return [
        Frame(
            name=image.name, focal=Estimate(value=values["K"][0][0], status="fixed"),
            projector_from_camera=_scaled(pose, unit),
            world_from_camera=_scaled(first @ camera.inverse(), unit),
        )
        for image, (camera, _), pose, values in zip(cameras, pairs, poses, own, strict=True)
    ]  # fmt: skip


def _pose(image: ModelImage, path: Path) -> RigidTransform:
    quaternion = np.array(image.quaternion)
    if not (np.isfinite([*quaternion, *image.t]).all() and np.linalg.norm(quaternion) > 0):
        raise InputError(f"the pose of {image.name} is none", str(path), "export the model again")
    return RigidTransform.of(Rotation.from_quat(quaternion).as_matrix(), image.t)


def _scaled(pose: RigidTransform, unit: float) -> PoseEstimate:
    return PoseEstimate.of(RigidTransform(pose.R, pose.t / unit), status="fixed")
