"""A camera and a projector in one file: what ``export --format opencv`` and stereo programs write.

``T`` has the unit that ``units`` names; without it, as from other programs, it is taken to be mm.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...geometry.transforms import RigidTransform
from ...reading.regular import is_file
from ..camera_files.camera_file import CameraFile, Values, numbers, square
from ..camera_files.document import Document, read_document
from ..camera_files.lenses import plain
from ..camera_files.matrices import content, matrix_key
from ..camera_files.registry import read_camera_file
from ..rig_camera import Camera
from ..rig_projector import GivenPose
from ..solution import Estimate, Frame, Outcome, PoseEstimate, ProjectorEstimate, Solution
from ..validation import validate
from .registry import register_calibration_format

SUFFIXES = (".yaml", ".yml", ".xml", ".json")
_R, _T = ("r", "rotation"), ("t", "translation")


def _matches(path: Path) -> bool:
    """Take FileStorage's suffixes; of JSON files those that hold a camera matrix by a name."""
    suffix = path.suffix.lower()
    if not is_file(path) or suffix not in SUFFIXES:
        return False
    return suffix != ".json" or matrix_key(read_document(path).data) is not None


@register_calibration_format("an OpenCV file of camera and projector", _matches)
def read(path: Path) -> Solution:
    """Read matrices, distortion and poses.

    Raises:
        InputError: no projector or no pose in it, no size of the image, or damage.
    """
    camera_file, _ = read_camera_file(path)
    document = read_document(path)
    projector = _projector(document) or camera_file.projector
    if not projector:
        raise InputError(
            "holds a camera and no projector", str(path),
            "give a stereo calibration of camera and projector",
        )  # fmt: skip
    camera = _camera(camera_file, str(path))
    frames, units = _frames(document, projector, str(path)), _units(document)
    return Solution(
        outcome=Outcome.TRUTH, units=units, scale="truth" if units == "mm" else "up_to_scale",
        camera=camera, projector=_estimates(projector), frames=frames,
    )  # fmt: skip


def _camera(file: CameraFile, where: str) -> Camera:
    if "width" not in file.camera:
        raise InputError("image_width or image_height is missing", where, "add them")
    return validate(Camera, file.camera, f"{where}: camera")


def _units(document: Document) -> Any:
    units = str(document.data.get("units", "mm"))
    if units not in ("mm", "baseline"):
        raise InputError(f"is '{units}'", f"{document.where}: units", "give mm or baseline")
    return units


def _projector(document: Document) -> Values:
    """Return the keys that this package's export writes; empty where the file has none."""
    data, where = document.data, document.where
    if "projector_law" not in data or "projector_matrix" not in data:
        return {}
    lens = data.get("projector_distortion_coefficients", [])
    values = _intrinsics(data["projector_matrix"], f"{where}: projector_matrix")
    distortion = numbers(content(lens), f"{where}: projector_distortion_coefficients")
    while distortion and distortion[-1] == 0:
        distortion.pop()
    size = {name: data.get(f"projector_{name}") for name in ("width", "height")}
    return {"law": str(data["projector_law"]), "distortion": distortion, **values, **size}


def _intrinsics(matrix: Any, where: str) -> Values:
    (fx, _, cx), (_, fy, cy), _ = square(content(matrix), where)
    if fx <= 0 or fy <= 0:
        raise InputError("has no positive focal length", where, "mend it")
    return {"focal": fx, "centre": [cx, cy], "aspect": fy / fx}


def _estimates(values: Values) -> ProjectorEstimate:
    focal = values["focal"]

    def known(value: Any) -> Estimate:
        return Estimate(value=value, status="fixed")

    return ProjectorEstimate(
        law=values.get("law", "pinhole"), width=values.get("width"), height=values.get("height"),
        focal=known(focal["value"] if isinstance(focal, dict) else focal),
        centre=known(values["centre"]), aspect=known(values.get("aspect", 1.0)),
        distortion=known(values.get("distortion", [])),
    )  # fmt: skip


def _frames(document: Document, projector: Values, where: str) -> list[Frame]:
    """Return the frames of this package's export, or the one pose that a file has."""
    listed = document.data.get("frames")
    if isinstance(listed, list) and listed and all(isinstance(f, dict) for f in listed):
        return [_frame(entry, f"{where}: frames") for entry in listed]
    given = projector.get("pose") or _pose_values(document.data, _R, _T, where)
    if given is None:
        raise InputError("R and T are missing", where, "give a stereo calibration")
    return [_named(Path(where).name, _pose(given, where), RigidTransform.identity())]


def _frame(entry: Values, where: str) -> Frame:
    world = RigidTransform.identity()
    pose = _pose_values(entry, _R, _T, where)
    if pose is None:
        raise InputError("R or T of a frame is missing", where, "export it again")
    placed = _pose_values(entry, ("worldr",), ("worldt",), where)
    if placed is not None:
        world = _pose(placed, where)
    frame = _named(str(entry.get("name", "frame")), _pose(pose, where), world)
    if "projector_matrix" not in entry:
        return frame
    own = _intrinsics(entry["projector_matrix"], f"{where}: projector_matrix")
    return frame.model_copy(update={"focal": Estimate(value=own["focal"], status="fixed")})


def _pose_values(
    data: Values, rotations: tuple[str, ...], translations: tuple[str, ...], where: str
) -> Values | None:
    spelt = {plain(key): key for key in data}
    R = next((spelt[name] for name in rotations if name in spelt), None)
    t = next((spelt[name] for name in translations if name in spelt), None)
    if R is None or t is None:
        return None
    return {"R": _rotation(data[R], f"{where}: {R}"), "t": numbers(content(data[t]), where, 3)}


def _rotation(value: Any, where: str) -> Any:
    flat = numbers(content(value), where)
    return flat if len(flat) == 3 else np.reshape(square(content(value), where), (3, 3)).tolist()


def _pose(values: Values, where: str) -> RigidTransform:
    return validate(GivenPose, values, where).to_transform()


def _named(name: str, pose: RigidTransform, world: RigidTransform) -> Frame:
    return Frame(
        name=name, projector_from_camera=PoseEstimate.of(pose, status="fixed"),
        world_from_camera=PoseEstimate.of(world, status="fixed"),
    )  # fmt: skip
