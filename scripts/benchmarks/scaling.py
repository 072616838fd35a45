"""From 4 to 16 frames: how time and memory grow."""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

from .report import Figure

NAME = "scaling"
_figure = partial(Figure, NAME)


def run(quick: bool) -> list[Figure]:
    """Measure each number of frames in a process of its own."""
    few, many, pixels = (2, 4, 80) if quick else (4, 16, 240)
    a, b = _child(few, pixels), _child(many, pixels)
    return [
        _figure(f"time from {few} to {many} frames", b["seconds"] / a["seconds"], "x", "lower", 5),
        _figure(f"memory beyond the input, from {few} to {many} frames",
                (b["peak_mb"] - b["input_mb"]) / (a["peak_mb"] - a["input_mb"]), "x", "lower", 1.5),
        _figure(f"time of {few} frames", a["seconds"], "s", "lower"),
        _figure(f"time of {many} frames", b["seconds"], "s", "lower"),
        _figure(f"peak memory of {few} frames", a["peak_mb"], "MB", "lower"),
        _figure(f"peak memory of {many} frames", b["peak_mb"], "MB", "lower"),
        _figure("memory before, libraries and kernels loaded", b["before_mb"], "MB", "lower"),
        _figure(f"frames used of {many}", b["used"], "", "higher"),
    ]  # fmt: skip


def _child(count: int, pixels: int) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.scaling", str(count), str(pixels)]
    folder = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def _measure(count: int, pixels: int) -> dict[str, float]:
    """Calibrate two frames to compile, then all."""
    from mitsuba_endo.solve.calibrate import calibrate

    from .frames import make_frames
    from .report import timed

    frames = make_frames(count, 0, pixels=pixels)
    calibrate(frames.maps[:2], frames.rig)
    before = _status("VmRSS")
    seconds, found = timed(lambda: calibrate(frames.maps, frames.rig))
    return {
        "seconds": seconds,
        "used": len(found.frames),
        "input_mb": sum(m.q.nbytes for m in frames.maps) / 1e6,
        "before_mb": before,
        "peak_mb": _status("VmHWM"),
    }


def _status(name: str) -> float:
    """Return an entry of this process's status, MB.

    The peak is taken from here since ``getrusage`` counts that of the parent too: a process that
    is started shares its parent's memory until it loads its own program.
    """
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(x.split()[1]) * 1024 / 1e6 for x in lines if x.startswith(f"{name}:"))


if __name__ == "__main__":
    from mitsuba_endo import backend

    backend.use()
    print(json.dumps(_measure(int(sys.argv[1]), int(sys.argv[2]))))
