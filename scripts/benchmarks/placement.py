"""Registration of four frames each on random scenes, from their range images."""

import sys
from functools import partial
from pathlib import Path

from mitsuba_endo.initialisation.registration import register_frames

from .report import Figure, timed

sys.path.insert(0, str(Path(__file__).parents[2]))  # the tests' scenes share no code with it
from tests.range_scenes import SURFACES, pose_errors, random_scene, silently_wrong

NAME = "registration"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Register scene after scene, up to 25 mm and 15 degrees between neighbouring frames."""
    scenes, kinds = (4 if quick else 40), list(SURFACES)
    right, silent, seconds = 0, 0, 0.0
    for i in range(scenes):
        scene = random_scene(kinds[i % len(kinds)], 200 + i)
        took, found = timed(lambda images=scene.images: register_frames(images))
        right += all(e.right for e in pose_errors(scene, found))
        silent += bool(silently_wrong(scene, found))
        seconds += took
    return [
        _figure("scenes", scenes, "", ""),
        _figure("scenes wholly right", 100 * right / scenes, "%", "higher", 95),
        _figure("scenes with a frame silently wrong", silent, "", "lower", 0),
        _figure("time of a scene", seconds / scenes, "s", "lower"),
    ]
