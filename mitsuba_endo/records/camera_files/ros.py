"""ROS: the files of ``camera_info_manager``, and printed ``sensor_msgs/CameraInfo`` messages."""

from typing import Any

from ...errors import InputError
from .camera_file import CameraFile, camera_file, numbers, square
from .document import Document
from .lenses import plain
from .matrices import content, image_size, matrix_key, read_matrices
from .registry import register_format

_FURTHER = ("binningx", "binningy", "roi")
_MESSAGE = {"height", "width", "distortionmodel", "d", "k", "r", "p"}


def _is_file(document: Document) -> bool:
    data = document.data
    key = matrix_key(data)
    return key is not None and isinstance(data[key], dict)


def _is_message(document: Document) -> bool:
    return {plain(key) for key in document.data} >= _MESSAGE


@register_format("ROS camera_info", lambda document: _is_file(document) or _is_message(document))
def read(document: Document) -> CameraFile:
    """Read image_width, camera_matrix, distortion_model, distortion_coefficients, or the message.

    Raises:
        InputError: the camera bins pixels or cuts its image, or a key is not known.
    """
    data, where = document.data, document.where
    for key in data:
        if plain(key).startswith("binning") and data[key] not in (0, 1):
            raise InputError(
                f"{key} is {data[key]}: matrix and image differ in size", where,
                "calibrate the camera as it is used",
            )  # fmt: skip
        if plain(key) == "roi" and _cuts(data[key]):
            raise InputError("roi cuts the image", where, "calibrate the camera as it is used")
    if not _is_message(document):
        return read_matrices(data, where, _FURTHER)
    by_name = {plain(key): value for key, value in data.items()}
    return camera_file(
        square(content(by_name["k"]), f"{where}: K"),
        numbers(content(by_name["d"]), f"{where}: D"),
        image_size(data, where),
        str(by_name["distortionmodel"]),
        where,
    )


def _cuts(roi: Any) -> bool:
    if not isinstance(roi, dict):
        return False
    return any(roi.get(name) for name in ("x_offset", "y_offset", "width", "height"))
