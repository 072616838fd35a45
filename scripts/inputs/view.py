"""What a camera sees of a pattern: a smooth map, the rig of it, and photographs, made by lot."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

PATTERN = (262, 207)
"""Width and height, pattern pixels."""
CAMERA = (340, 260)
"""Width and height, pixels."""
BLUR, NOISE, AMBIENT, GAIN = 0.6, 0.004, 0.08, 0.75
"""Of photographs: pixels, and shares of full scale."""


@cache
def truth() -> NDArray[np.float32]:
    """Return the map (H, W, 2): a bent sheet that shows all of the pattern, tilted."""
    x, y = np.meshgrid(np.arange(CAMERA[0]), np.arange(CAMERA[1]))
    u = -8 + 0.82 * x + 0.03 * y + 3 * np.sin(y / 60) + 2e-4 * (x - 150) ** 2
    v = -6 + 0.84 * y - 0.04 * x + 2 * np.sin(x / 70)
    q = np.stack([u, v], -1).astype(np.float32)
    inside = ((q >= -0.5) & (q <= np.array(PATTERN) - 0.5)).all(-1, keepdims=True)
    return np.where(inside, q, np.float32(np.nan))


def write_rig(folder: Path, **camera: Any) -> Path:
    """Write a rig file for the map."""
    width, height = CAMERA
    rig = {
        "units": "mm",
        "camera": camera or {
            "width": width, "height": height,
            "K": [[280.0, 0, 171], [0, 280.0, 128], [0, 0, 1]],
        },
        "projector": {"law": "pinhole", "width": PATTERN[0], "height": PATTERN[1],
                      "centre": [130.0, 103.0]},
        "scale": {"baseline": 6.2},
    }  # fmt: skip
    path = folder / "rig.yaml"
    path.write_text(yaml.safe_dump(rig), "utf-8")
    return path


def photographs(patterns: Sequence[NDArray[np.uint8]]) -> list[NDArray[np.uint8]]:
    """Return a photograph of each pattern: blur, albedo, ambient light, noise, 8 bits."""
    rng = np.random.default_rng(1)
    q = np.nan_to_num(truth(), nan=-99)
    albedo = cv2.GaussianBlur(rng.random(q.shape[:2]).astype(np.float32), (0, 0), 4) + 0.5
    images = []
    for pattern in patterns:
        projected = cv2.GaussianBlur(pattern.astype(np.float32) / 255, (0, 0), 0.4)
        light = cv2.remap(projected, q[..., 0], q[..., 1], cv2.INTER_LINEAR)
        image = cv2.GaussianBlur(albedo * (GAIN * light + AMBIENT), (0, 0), BLUR)
        image += NOISE * rng.standard_normal(image.shape)
        images.append(np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8))
    return images
