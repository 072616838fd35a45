"""The height of a shifted lens's centre is found from one map, with focal length and pose."""

from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.geometry.cameras import CameraModel
from mitsuba_endo.geometry.projection_models import projector_model
from mitsuba_endo.geometry.transforms import RigidTransform
from mitsuba_endo.initialisation.lens_shift import LensShift, find_lens_shift, frame_samples
from tests import rigs

SIZE = (512, 400)
MIDDLE = (255.5, 199.5)
POSE = RigidTransform.of([0.05, -0.1, 0.04], [-6.0, 2.0, 1.5])
CAPTURES = Path(__file__).parents[3] / "shared" / "real" / "kamino"


def _rig(height: float) -> rigs.Rig:
    """Return a rig whose projector's centre lies at a share of the pattern's height."""
    centre = (MIDDLE[0], height * (SIZE[1] - 1))
    # Turned so that the pattern, all of which lies to one side of the axis, is seen.
    pose = RigidTransform.of([0.6 * (height - 0.5), -0.1, 0.04], POSE.t)
    surface = rigs.bumpy_sheet(70, (0.2, -0.3), 7, 3)
    camera = rigs.lopsided_camera(160, 112)
    rig = rigs.cast(camera, projector_model("pinhole", 600.0, centre), SIZE, pose, surface)
    assert np.isfinite(rig.q[..., 0]).mean() > 0.4
    return rigs.with_outliers(rigs.with_noise(rig, 0.3, 1), 0.1, 1)


def _found(rig: rigs.Rig) -> LensShift:
    frame = frame_samples(rig.q, rig.camera, np.random.default_rng(0))
    return find_lens_shift([frame], rig.unknown_projector.with_(centre=MIDDLE), SIZE)


@pytest.mark.parametrize("height", [0.0, 1.07])
def test_finds_a_shifted_centre(height: float):
    """Oracle: the rig's centre and focal length; noise 0.3 px and 10 % outliers allow 6 px, 1 %."""
    rig = _rig(height)
    shift = _found(rig)
    assert shift.off_middle
    assert shift.centre[0] == MIDDLE[0]
    assert shift.centre[1] == pytest.approx(rig.projector.centre[1], abs=6)
    assert shift.states[0].projector.focal == pytest.approx(600, rel=0.01)


def test_keeps_the_middle_where_it_is_right():
    """Oracle: at the rig's own centre nothing else is clearly better."""
    shift = _found(_rig(0.5))
    assert not shift.off_middle
    assert shift.centre == MIDDLE


def test_frames_that_share_a_centre():
    """Oracle: the rig's centre; two frames with poses of their own find one height."""
    frames = []
    for seed, rig in enumerate((_rig(1.07), rigs.with_noise(_rig(1.07), 0.2, 5))):
        frames.append(frame_samples(rig.q, rig.camera, np.random.default_rng(seed)))
    shift = find_lens_shift(frames, rig.unknown_projector, SIZE)
    assert shift.off_middle
    assert shift.centre[1] == pytest.approx(rig.projector.centre[1], abs=6)
    assert shift.scale_px < 0.95 * shift.middle_scale_px


@pytest.mark.slow
@pytest.mark.skipif(not CAPTURES.is_dir(), reason=f"{CAPTURES} is absent")
@pytest.mark.parametrize("number", range(5))
def test_finds_a_real_shift(number: int):
    """Oracle: a chessboard calibration independent of the maps, to 20 px of 768, and 1 % in f."""
    with np.load(CAPTURES / f"capture_{number}_small.npz") as file:
        c = {name: file[name] for name in file.files}
    K = c["K_proj"]
    width, height = (int(n) for n in c["cam_size"])
    w, h = (int(n) for n in c["proj_size"])
    projector = projector_model(
        "pinhole", float("nan"), ((w - 1) / 2, (h - 1) / 2), K[1, 1] / K[0, 0],
        tuple(c["dist_proj"]),
    )  # fmt: skip
    camera = CameraModel("opencv", width, height, c["K_cam"], tuple(c["dist_cam"]))
    frame = frame_samples(c["map"], camera, np.random.default_rng(0))
    shift = find_lens_shift([frame], projector, (w, h))
    assert shift.centre[1] == pytest.approx(K[1, 2], abs=20)
    assert shift.states[0].projector.focal == pytest.approx(K[0, 0], rel=0.01)
