"""The JSON of calib.io's Camera Calibrator."""

from typing import Any

from ...errors import InputError
from .camera_file import CameraFile, camera_file, matrix
from .document import Document
from .lenses import LENS_NAMES
from .registry import chosen, register_format

_MODELS = {"libCalib::CameraModelOpenCV": "opencv", "libCalib::CameraModelFisheye": "fisheye"}


def _cameras(document: Document) -> list[Any]:
    calibration = document.data.get("Calibration")
    cameras = calibration.get("cameras") if isinstance(calibration, dict) else None
    return cameras if isinstance(cameras, list) else []


@register_format("calib.io", lambda document: bool(_cameras(document)))
def read(document: Document) -> CameraFile:
    """Read f, ar, cx, cy and the coefficients by their names.

    Raises:
        InputError: another model, a coefficient that is not known, or several cameras.
    """
    cameras = _cameras(document)
    number = int(chosen([str(k) for k in range(len(cameras))], document))
    where = f"{document.where}: camera {number}"
    try:
        model = cameras[number]["model"]
        kind, held = model["polymorphic_name"], model["ptr_wrapper"]["data"]
        values = {name: float(entry["val"]) for name, entry in held["parameters"].items()}
        size = held["CameraModelCRT"]["CameraModelBase"]["imageSize"]
        f, ar, cx, cy = (values.pop(name) for name in ("f", "ar", "cx", "cy"))
        width, height = int(size["width"]), int(size["height"])
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise InputError("lacks a part of the camera", where, "export it again") from None
    if kind not in list(_MODELS):
        raise InputError(
            f"the camera model '{kind}' is not known", where, "calibrate with OpenCV's"
        )
    names = [n.replace("tau_x", "tauX").replace("tau_y", "tauY") for n in LENS_NAMES[_lens(kind)]]
    unknown = [name for name, value in values.items() if name not in names and value]
    if unknown:
        raise InputError(f"the coefficient '{unknown[0]}' is not known", where, "calibrate without")
    coefficients = [values.get(name, 0.0) for name in names]
    return camera_file(
        matrix(f, f * ar, cx, cy), coefficients, (width, height), _MODELS[kind], where
    )


def _lens(kind: str) -> str:
    return "opencv" if _MODELS[kind] == "opencv" else "opencv_fisheye"
