"""A bright line on translucent tissue: how far its light spreads, as blur and as medium."""

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.capture.photograph import photograph
from mitsuba_endo.capture.settings import CaptureSettings, Effects, Tissue
from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.shapes import make_shape

DISTANCE_MM, PIXELS_PER_MM = 40.0, 8.0
WIDTH, HEIGHT = 161, 120
PARTS = 8
"""Photographs whose median a profile is: rare bright paths would spoil a mean."""


def line_spread(subsurface: str, mean_free_path: float, spp: int) -> NDArray[np.float64]:
    """Return the green profile (WIDTH,) across a vertical line, of sum 1.

    A plane 40 mm away, 8 pixels per mm; the line is 0.3 mm wide. The profile is the mean over
    the image's rows.
    """
    focal = DISTANCE_MM * PIXELS_PER_MM
    K = np.array([[focal, 0, (WIDTH - 1) / 2], [0, focal, (HEIGHT - 1) / 2], [0, 0, 1]])
    x = np.arange(480) - 239.5
    line = np.exp(-0.5 * x**2).astype(np.float32)
    tissue = Tissue(
        vessel_contrast=0, relief=0, clearcoat=0, roughness=0.5, base_color=(0.7, 0.5, 0.3),
        subsurface=subsurface, mean_free_path=mean_free_path,  # pyright: ignore[reportArgumentType]
    )  # fmt: skip
    profiles = []
    for seed in range(PARTS):
        taken = photograph(
            make_shape("plane", width=400, height=400, distance=DISTANCE_MM, edge=20),
            CameraModel("opencv", WIDTH, HEIGHT, K), RigidTransform.identity(),
            projector_model("pinhole", 300.0, (239.5, 191.5)),
            RigidTransform.of([0, 0.15, 0], [-6.0, 0, 0.9]),
            np.tile(line[None, :, None], (384, 1, 3)),
            CaptureSettings(tissue=tissue, effects=Effects(shot=None), spp=max(1, spp // PARTS),
                            max_depth=2), seed,
        )  # fmt: skip
        profiles.append(taken.radiance[..., 1].mean(0))
        if subsurface != "medium":
            break  # free of noise
    profile = np.median(profiles, 0).astype(np.float64)
    return profile / profile.sum()
