"""The search on real structured-light captures, where their folder is present."""

from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import angle_between, rotation_angle
from mitsuba_endo.initialisation.search import search_start

CAPTURES = Path(__file__).parents[3] / "shared" / "real" / "kamino"


@pytest.mark.skipif(not CAPTURES.is_dir(), reason=f"{CAPTURES} is absent")
@pytest.mark.parametrize("number", range(5))
def test_finds_a_real_rig(number):
    """Oracle: a chessboard calibration independent of the maps, to 1 %, 0.3 and 2 degrees.

    Given are camera, projector centre and distortion; not focal length and pose.
    """
    with np.load(CAPTURES / f"capture_{number}_small.npz") as file:
        c = {name: file[name] for name in file.files}
    K = c["K_proj"]
    width, height = (int(n) for n in c["cam_size"])
    start = search_start(
        c["map"],
        CameraModel("opencv", width, height, c["K_cam"], tuple(c["dist_cam"])),
        projector_model(
            "pinhole", float("nan"), (K[0, 2], K[1, 2]), K[1, 1] / K[0, 0], tuple(c["dist_proj"])
        ),
        (int(c["proj_size"][0]), int(c["proj_size"][1])),
    )
    assert start.projector.focal == pytest.approx(K[0, 0], rel=0.01)
    assert rotation_angle(start.projector_from_camera.R @ c["R"].T) < np.radians(0.3)
    assert angle_between(start.projector_from_camera.t, c["t"]) < np.radians(2)
