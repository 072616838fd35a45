"""Sound input draws no finding: a false alarm is worse than a miss."""

from pathlib import Path

import numpy as np
import pytest

from mitsuba_endo.records.known_input import known_rig
from mitsuba_endo.records.rig import Camera, Rig
from mitsuba_endo.sanity.examine import examine
from tests.sanity.given import map_of, noisy, record, thinned

CAPTURES = Path(__file__).parents[3] / "shared" / "real" / "kamino"
SCENES = ("colon", "sphere", "stomach", "sheet", "rabbit", "plane")


def test_random_rigs():
    """Oracle: rigs with correct maps, two camera models, both laws, 1 px, 30 % outliers, slips."""
    for seed in range(30):
        rig = noisy(seed)
        assert examine([map_of(rig.q)], record(rig)).warnings == []


@pytest.mark.parametrize("step", [2, 3, 5])
def test_thinned_and_rounded_maps(step: int):
    """Oracle: a right map of whole numbers (Gray code), and one with every ``step``-th pixel."""
    for seed in (4, 7, 10):
        rig = noisy(seed)
        for q in (np.round(rig.q), thinned(rig, step).q, np.round(rig.q / 4) * 4):
            assert examine([map_of(q)], record(rig)).warnings == []


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("scene", SCENES)
def test_scenes(scene: str):
    """Oracle: the scenes' own maps and rigs, as ``render`` writes them."""
    from mitsuba_endo.rendering.render import render_capture
    from mitsuba_endo.rendering.scene import load_scene

    loaded = load_scene(scene, width="240", height="180", fx="170", cx="120.5", cy="88.6")
    capture = render_capture(loaded, spp=1, seed=0, name="map.exr")
    examined = examine([map_of(capture.correspondences())], known_rig(capture.truth))
    assert examined.warnings == []


@pytest.mark.skipif(not CAPTURES.is_dir(), reason=f"{CAPTURES} is absent")
def test_real_captures():
    """Oracle: captures of a real rig whose calibration is right."""
    maps = []
    for k in range(5):
        with np.load(CAPTURES / f"capture_{k}_small.npz") as file:
            c = {name: file[name] for name in file.files}
        maps.append(map_of(c["map"], f"{k}"))
    K = c["K_proj"]
    width, height = (int(n) for n in c["cam_size"])
    rig = Rig(
        camera=Camera(width=width, height=height, K=c["K_cam"].tolist(),
                      distortion=c["dist_cam"].ravel().tolist()),
        projector={"law": "pinhole", "width": int(c["proj_size"][0]), "height":
                   int(c["proj_size"][1]), "centre": [K[0, 2], K[1, 2]],
                   "distortion": c["dist_proj"].ravel().tolist()},  # pyright: ignore
    )  # fmt: skip
    assert examine(maps, rig).warnings == []
