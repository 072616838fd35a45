"""Real captures solved together: surface per frame, projector pose and focal length shared."""

from functools import partial

import numpy as np

from mitsuba_endo.geometry.transforms import angle_between
from mitsuba_endo.records.correspondence import load_map
from mitsuba_endo.records.rig import Share
from mitsuba_endo.solve.calibrate import calibrate

from .real_captures import CAPTURES, _rig
from .report import Figure, timed

NAME = "shared rig"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Calibrate all captures at once; nothing where the folder is absent."""
    paths = sorted(CAPTURES.glob("capture_*_small.npz"))[: 2 if quick else None]
    if not paths:
        return []
    with np.load(paths[0]) as file:
        arrays = dict(file)
    rig = _rig(arrays).model_copy(
        update={"share": Share(surface="per_frame", projector_pose="shared")}
    )
    seconds, found = timed(lambda: calibrate([load_map(p) for p in paths], rig))
    focal = found.solution.projector.focal
    pose = found.solution.frames[0].projector_from_camera.to_transform()
    if pose is None or not isinstance(focal.value, float) or not isinstance(focal.std, float):
        raise RuntimeError("focal length or pose was not determined")
    true = float(arrays["K_proj"][0, 0])
    direction = float(np.degrees(angle_between(pose.t, arrays["t"])))
    error, std = 100 * (focal.value / true - 1), 100 * focal.std / true
    return [
        _figure("captures", len(paths), "", ""),
        _figure("focal error", abs(error), "%", "lower", 0.3),
        _figure("translation direction error", direction, "deg", "lower", 0.7),
        _figure("stated standard deviation of the focal length", std, "%", ""),
        _figure("error over stated deviation", abs(error) / std, "", "lower", 3),
        _figure("time", seconds, "s", "lower"),
    ]  # fmt: skip
