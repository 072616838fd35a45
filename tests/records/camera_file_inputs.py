"""Camera files for tests: the same camera in the words of several programs."""

import json
from pathlib import Path

import cv2
import numpy as np
import yaml

from mitsuba_endo.records.camera_files import read_camera_file
from mitsuba_endo.records.rig import Camera

K = [[200.5, 0.0, 120.4], [0.0, 199.0, 88.6], [0.0, 0.0, 1.0]]
FLAT = [v for row in K for v in row]
BROWN = [-0.1, 0.02, 0.001, -0.002, 0.003]


def write(path: Path, content: object) -> Path:
    """Write text as it is, and values as JSON or YAML by the suffix."""
    if not isinstance(content, str):
        content = json.dumps(content) if path.suffix == ".json" else yaml.safe_dump(content)
    path.write_text(content)
    return path


def storage(path: Path, **values: object) -> Path:
    """Write an OpenCV FileStorage with OpenCV's own writer."""
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        file.write(name, np.array(value, float) if isinstance(value, list) else value)
    file.release()
    return path


def camera_of(path: Path) -> Camera:
    file, _ = read_camera_file(path)
    return Camera.model_validate({"width": 240, "height": 180, **file.camera})


def check(camera: Camera, model: str = "opencv", distortion: list[float] = BROWN) -> None:
    """Compare with K, 240 x 180 pixels, and the coefficients up to zeros at the end."""
    assert camera.model == model
    assert (camera.width, camera.height) == (240, 180)
    np.testing.assert_allclose(camera.K, K, rtol=1e-12)
    padded = [*camera.distortion, *[0.0] * 8][:8]
    np.testing.assert_allclose(padded, [*distortion, *[0.0] * 8][:8], rtol=1e-9)


def ros(**changes: object) -> dict[str, object]:
    return {
        "image_width": 240, "image_height": 180, "camera_name": "head",
        "camera_matrix": {"rows": 3, "cols": 3, "data": FLAT}, "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": BROWN},
        "rectification_matrix": {"rows": 3, "cols": 3, "data": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
        "projection_matrix": {"rows": 3, "cols": 4, "data": [0.0] * 12},
        **changes,
    }  # fmt: skip


def kalibr(model: str, intrinsics: list[float], lens: str, coefficients: list[float]) -> dict:
    return {
        "camera_model": model, "intrinsics": intrinsics, "distortion_model": lens,
        "distortion_coeffs": coefficients, "resolution": [240, 180], "rostopic": "/head",
    }  # fmt: skip


PINHOLE = [200.5, 199.0, 120.4, 88.6]
