"""One small calibration and what tells its result from others, to the last bit.

``python -m tests.reliability.one_calibration THREADS`` prints it for Dr.Jit's number of threads.
"""

import hashlib
import json
import sys
from typing import Any

from mitsuba_endo import backend
from mitsuba_endo.solve.calibrate import calibrate
from mitsuba_endo.solve.options import Options
from tests.solve.views import look, projector_poses, relief_surface, steps

OPTIONS = Options(jackknife=False)
SEED = 0
"""Of the noise."""
WIDTH = 48
"""Of the camera, pixels."""


def digest(threads: int | None = None) -> dict[str, str]:
    """Calibrate, and return a digest of each part of the result.

    Args:
        threads: of Dr.Jit; None: as they are.
    """
    backend.use("llvm_ad_rgb")
    import drjit as dr

    if threads is not None:
        dr.set_thread_count(threads)
    views = look(relief_surface(), steps(1), projector_poses(1), width=WIDTH, seed=SEED)
    result = calibrate(views.maps, views.rig(), OPTIONS)
    # Times and versions are no result.
    solution = result.solution.model_dump_json(exclude={"timings", "versions"})
    assert result.surface is not None
    assert result.checkpoint is not None
    return {
        "solution": _digest(solution.encode()),
        "surface": _digest(result.surface.vertices.tobytes() + result.surface.faces.tobytes()),
        "deviations": _digest(result.surface.std.tobytes()),
        "rendered": _digest(result.frames[0].rendered.tobytes()),
        "state": _digest(*(v.tobytes() for s in result.checkpoint.values.values() for v in s)),
    }


def _digest(*parts: bytes) -> str:
    return hashlib.blake2b(b"".join(parts), digest_size=8).hexdigest()


def send(queue: Any) -> None:
    """Put the digest, or the exception, into a queue: of a child process."""
    try:
        queue.put(digest())
    except BaseException as error:
        queue.put(f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    print(json.dumps(digest(int(sys.argv[1]))))
