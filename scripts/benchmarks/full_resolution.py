"""One frame of 640 x 480 at full resolution: time of the solve, and peak memory of the process."""

import json
import resource
import subprocess
import sys
from functools import partial
from pathlib import Path

from .report import Figure, timed

NAME = "resolution"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Measure in a process of its own, whose memory nothing else has touched."""
    size = ("160", "120") if quick else ("640", "480")
    command = [sys.executable, "-m", "benchmarks.full_resolution", *size]
    folder = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    child = json.loads(done.stdout.splitlines()[-1])
    return [
        _figure("time without the start", child["solve"], "s", "lower", 4),
        _figure("time with the start", child["whole"], "s", "lower"),
        _figure("peak memory", child["peak_gb"], "GB", "lower", 2),
        _figure("focal error", child["focal_error_percent"], "%", "lower"),
    ]


def _measure(width: int, height: int) -> dict[str, float]:
    """Calibrate twice, the first time to compile; report the second."""
    from mitsuba_endo.solve.calibrate import calibrate

    from .scene import TRUE_FOCAL, make_scene

    scene = make_scene(width, height)
    calibrate([scene.map], scene.rig)
    seconds, found = timed(lambda: calibrate([scene.map], scene.rig))
    focal = found.solution.projector.focal.value
    assert isinstance(focal, float)
    return {
        "whole": seconds,
        "solve": seconds - found.solution.timings["start"],
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        "focal_error_percent": 100 * abs(focal / TRUE_FOCAL - 1),
    }


if __name__ == "__main__":
    from mitsuba_endo import backend

    backend.use()
    print(json.dumps(_measure(int(sys.argv[1]), int(sys.argv[2]))))
