"""Files that hold a camera and a projector.

ProCamCalib (Audet) keeps a part for each device; the programs of Moreno and Taubin and of kamino
write both flat, as ``cam_K`` and ``proj_K``, or ``cam_int`` and ``proj_int``.
"""

from typing import Any

import numpy as np

from ...errors import InputError
from .camera_file import CameraFile, Values, numbers, pixels, square
from .document import Document
from .matrices import DISTORTION, content, find, image_size, matrix_key, read_matrices
from .registry import register_format

_MATRIX = ("projint", "projk", "projmatrix", "projectormatrix", "projectorintrinsics")
_LENS = ("projdist", "projkc", "projdistcoeffs", "projectordistortion", "projectordistcoeffs")
_WIDTH = ("projwidth", "projectorwidth")
_HEIGHT = ("projheight", "projectorheight")
_R = ("rotation", "roration", "r")
"""kamino's program spells it so."""
_T = ("translation", "t")
_ROUNDING = 1e-4
"""By which a rotation's entries, written in few digits, may exceed one."""
_FURTHER = (*_MATRIX, *_LENS, *_WIDTH, *_HEIGHT, "projshape", "projectorshape", "roration")
_OF_DEVICE = (
    "responsegamma", "extrparams", "reprojerrs", "avgreprojerr", "maxreprojerr", "avgepipolarerr",
    "maxepipolarerr", "colororder", "colormixingmatrix", "additivelight", "avgcolorerr", "colorr2",
    "nominaldistance", "initaspectratio",
)  # fmt: skip


def _is_flat(document: Document) -> bool:
    return (
        matrix_key(document.data) is not None
        and find(document.data, _MATRIX) is not None
        and (find(document.data, ("projectorlaw",)) is None)
    )


@register_format("calibration of a camera and a projector (kamino, Moreno and Taubin)", _is_flat)
def read_flat(document: Document) -> CameraFile:
    """Read cam_int, cam_dist, proj_int, proj_dist, rotation, translation, or cam_K and so on."""
    data, where = document.data, document.where
    lens, width, height = find(data, _LENS), find(data, _WIDTH), find(data, _HEIGHT)
    R, t = find(data, _R), find(data, _T)
    projector = _projector(
        data[str(find(data, _MATRIX))], data[lens] if lens else [],
        data[R] if R and t else None, data[t] if R and t else None, where,
    )  # fmt: skip
    if width and height:
        size = pixels([data[width], data[height]], f"{where}: {width}")
        projector |= {"width": size[0], "height": size[1]}
    return read_matrices(data, where, _FURTHER, projector)


def _devices(document: Document, kind: str) -> list[str]:
    names = document.data.get(kind)
    names = names if isinstance(names, list) else []
    return [str(name) for name in names if isinstance(document.data.get(str(name)), dict)]


@register_format("ProCamCalib", lambda document: bool(_devices(document, "Cameras")))
def read_devices(document: Document) -> CameraFile:
    """Read the first camera and the first projector of a file of ProCamCalib.

    Raises:
        InputError: several cameras or projectors, or a key of the camera that is not known.
    """
    cameras, projectors = _devices(document, "Cameras"), _devices(document, "Projectors")
    if len(cameras) > 1 or len(projectors) > 1:
        names = ", ".join([*cameras, *projectors])
        raise InputError(f"holds {names}", document.where, "keep one camera and one projector")
    camera, where = document.data[cameras[0]], f"{document.where}: {cameras[0]}"
    projector: Values = {}
    if projectors:
        part, name = document.data[projectors[0]], f"{document.where}: {projectors[0]}"
        lens, matrix = find(part, DISTORTION), matrix_key(part)
        if matrix is not None:
            R, t = _relative(camera, part, name)
            projector = _projector(part[matrix], part[lens] if lens else [], R, t, name)
            size = image_size(part, name)
            projector |= {"width": size[0], "height": size[1]} if size else {}
    return read_matrices(camera, where, _OF_DEVICE, projector)


def _relative(camera: Values, projector: Values, where: str) -> tuple[Any, Any]:
    """Return R and t from the camera to the projector; a device's own are from the reference.

    Raises:
        InputError: a rotation is none.
    """
    poses = []
    for part in (projector, camera):
        R, t = find(part, ("r",)), find(part, ("t",))
        if not R or not t:
            return None, None
        rotation = np.array(square(part[R], f"{where}: {R}"))
        if not np.abs(rotation).max() < 1 + _ROUNDING:
            raise InputError("is no rotation", f"{where}: {R}", "mend it")
        poses.append((rotation, np.array(numbers(part[t], f"{where}: {t}", 3))))
    (Rp, tp), (Rc, tc) = poses
    return (Rp @ Rc.T).tolist(), (tp - Rp @ Rc.T @ tc).tolist()


def _projector(matrix: Any, lens: Any, R: Any, t: Any, where: str) -> Values:
    """Return the rig file's keys of a pinhole projector: focal length and pose are starts.

    Raises:
        InputError: more than the five coefficients that projectors have here, or a skew.
    """
    (fx, skew, cx), (_, fy, cy), _ = square(content(matrix), f"{where}: projector's matrix")
    if skew or not fx > 0 or not fy > 0:
        raise InputError("is no matrix without skew", f"{where}: projector's matrix", "mend it")
    coefficients = numbers(content(lens), f"{where}: projector's distortion")
    while coefficients and not coefficients[-1]:
        coefficients.pop()
    if len(coefficients) > 5:
        raise InputError(
            f"the projector has {len(coefficients)} coefficients", where, "calibrate with 5 at most"
        )
    values: Values = {
        "law": "pinhole", "focal": {"value": fx, "refine": True}, "centre": [cx, cy],
        "aspect": fy / fx, "distortion": coefficients,
    }  # fmt: skip
    if R is not None:
        rotation = square(content(R), f"{where}: rotation")
        values["pose"] = {"R": rotation, "t": numbers(content(t), f"{where}: translation", 3)}
    return values
