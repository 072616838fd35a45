"""Camera files of other programs, and rigs that do not fit."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from mitsuba_endo.records.correspondence import CorrespondenceMap
from mitsuba_endo.records.rig import read_rig
from mitsuba_endo.sanity.examine import examine

from .case import REFUSED, RIGHT, TOLD, Case, Ending
from .view import CAMERA, truth, write_rig

K = [[280.0, 0.0, 171.0], [0.0, 280.0, 128.0], [0.0, 0.0, 1.0]]
FLAT = [v for row in K for v in row]
BROWN = [-0.1, 0.02, 0.001, -0.001, 0.0]
FISHEYE = [-0.02, 0.01, -0.002, 0.0003]
WIDTH, HEIGHT = CAMERA


def case(
    brings: str,
    content: object,
    model: str = "opencv",
    wanted: list[float] | None = None,
    name: str = "camera.yaml",
    expected: str = RIGHT,
    says: str = "",
    **camera: object,
) -> Case:
    """Return a case of a camera file with K above, a model and coefficients."""

    def run(folder: Path) -> Ending:
        text = content if isinstance(content, str) else yaml.safe_dump(content)
        (folder / name).write_text(text, "utf-8")
        rig, _ = read_rig(write_rig(folder, file=name, **camera))
        found = [*rig.camera.distortion, *[0.0] * 14][:14]
        same = expected == TOLD or np.allclose(rig.camera.K, K)
        right = rig.camera.model == model and same and np.allclose(
            found, [*(BROWN if wanted is None else wanted), *[0.0] * 14][:14])  # fmt: skip
        maps = [CorrespondenceMap(truth(), "map.npy")]
        return Ending(0.0 if right else np.inf, examine(maps, rig).warnings)

    return Case("camera", brings, expected, says, run)


def ros(**changes: Any) -> dict[str, Any]:
    return {
        "image_width": WIDTH, "image_height": HEIGHT, "camera_name": "head",
        "camera_matrix": {"rows": 3, "cols": 3, "data": FLAT}, "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": BROWN}, **changes,
    }  # fmt: skip


def storage(matrix: str, lens: str, coefficients: list[float], **more: object) -> dict[str, object]:
    return {
        "image_width": WIDTH, "image_height": HEIGHT,
        matrix: {"rows": 3, "cols": 3, "data": FLAT},
        lens: {"rows": 1, "cols": len(coefficients), "data": coefficients}, **more,
    }  # fmt: skip


RATIONAL = [*BROWN, 0.01, 0.002, 0.0003]
OPENCV = "camera_matrix", "distortion_coefficients"

CASES = [
    case("ROS camera_info", ros()),
    case("ROS camera_info, equidistant",
         ros(distortion_model="equidistant",
             distortion_coefficients={"rows": 1, "cols": 4, "data": FISHEYE}),
         "opencv_fisheye", FISHEYE),
    case("ROS camera_info of a region of the image",
         ros(roi={"x_offset": 8, "y_offset": 0, "height": 200, "width": 200, "do_rectify": False}),
         expected=REFUSED, says="roi"),
    case("Kalibr camchain, equidistant",
         {"cam0": {"camera_model": "pinhole", "distortion_model": "equidistant",
                   "distortion_coeffs": FISHEYE, "intrinsics": [280.0, 280.0, 171.0, 128.0],
                   "resolution": [WIDTH, HEIGHT]}}, "opencv_fisheye", FISHEYE),
    case("COLMAP cameras.txt", f"# cameras\n1 OPENCV {WIDTH} {HEIGHT} 280 280 171.5 128.5 "
         f"{' '.join(map(str, BROWN[:4]))}\n", name="cameras.txt"),
    case("OpenCV, `mtx` and `dist`", storage("mtx", "dist", BROWN)),
    case("MATLAB exporter, `dist_coeff`", storage("camera_matrix", "dist_coeff", BROWN)),
    case("OpenCV, 14 coefficients, six of them 0", storage(*OPENCV, [*RATIONAL, *[0.0] * 6]),
         wanted=RATIONAL),
    case("OpenCV, 14 coefficients with a thin prism",
         storage(*OPENCV, [*RATIONAL, 0.1, *[0.0] * 5]), expected=REFUSED, says="s1 is 0.1"),
    case("an unknown key beside the matrix", storage(*OPENCV, BROWN, warp=[1, 2]), expected=REFUSED,
         says="warp"),
    case("the matrix of an image of twice the size",
         storage(*OPENCV, BROWN, camera_matrix={"rows": 3, "cols": 3,
                 "data": [560.0, 0, 342.5, 0, 560.0, 256.5, 0, 0, 1]}),
         expected=TOLD, says="belongs to images of about 686 x 514 px"),
    case("coefficients that fold the lens within the image",
         storage(*OPENCV, [-0.9, 0.05, 0, 0, 0]), expected=REFUSED,
         says="fold back inside the image"),
]  # fmt: skip
