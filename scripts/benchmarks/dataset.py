"""Making datasets: throughput against bare rendering, memory over many samples, 1,000 samples."""

import json
import os
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_endo.dataset.config import Config
from mitsuba_endo.dataset.local_pool import LocalPool
from mitsuba_endo.dataset.run import Progress, make_dataset
from mitsuba_endo.dataset.work import Job, Result, prepare, produce

from .report import Figure, timed

NAME = "dataset"
_figure = partial(Figure, NAME)
WORKERS = 2
WARM = 50
"""Samples after which a worker's memory should stay as it is."""
NOTES = "notes"
_rendering = [0.0]
"""Seconds spent in mi.render by this process, in a list so that the wrapper can add to it."""


def run(quick: bool) -> list[Figure]:
    """Make samples as the command does, with a stopwatch around every mi.render."""
    with tempfile.TemporaryDirectory() as folder:
        return [*_throughput(Path(folder) / "fast", 8 if quick else 100, quick),
                *_memory(Path(folder) / "long", 12 if quick else 500, quick)]  # fmt: skip


def _throughput(out: Path, count: int, quick: bool) -> list[Figure]:
    """Measure two workers at the built-in settings: 320 x 240 pixels, 16 samples a pixel.

    Samples go into shards, as for training.
    """
    config = Config.model_validate(_tiny() if quick else {"format": "hdf5"})
    seconds, done = timed(lambda: _make(config, out, count, WORKERS))
    notes = _notes(out)
    rendering = sum(note["rendering"] for note in notes)
    working = sum(note["seconds"] for note in notes)
    return [
        _figure(f"rendering by workers' time, with their start ({done.done} samples)",
                rendering / (WORKERS * seconds), "ratio", "higher", None if quick else 0.85),
        _figure("rendering by samples' time", rendering / working,
                "ratio", "higher", None if quick else 0.85),
        _figure(f"samples by {WORKERS} workers", 60 * done.done / seconds, "per minute", "higher"),
        _figure(f"1,000 samples, estimated from {done.done}", 1000 / done.done * seconds / 60,
                "min", "lower", None if quick else 60),
        _figure("failed samples", done.failed, "", "lower"),
    ]  # fmt: skip


def _memory(out: Path, count: int, quick: bool) -> list[Figure]:
    """Measure one worker that is never replaced, with small pictures of every kind of scene."""
    _make(Config.model_validate(_tiny()), out, count, 1)
    sizes = [note["memory"] for note in _notes(out)]
    warm = min(WARM, count // 2)
    growth = 100 * (np.mean(sizes[-warm // 2 :]) / np.mean(sizes[warm // 2 : warm]) - 1)
    return [
        _figure(f"memory after {count} samples by that after {warm}", float(growth), "% more",
                "lower", None if quick else 10),
        _figure("memory of a worker", sizes[-1], "MB", "lower"),
    ]  # fmt: skip


def _tiny() -> dict[str, Any]:
    return {"camera": {"width": 96, "height": 72}, "capture": {"spp": 2}, "format": "hdf5"}


def _make(config: Config, out: Path, count: int, workers: int) -> Progress:
    def pool(job: Job) -> LocalPool:
        return LocalPool(job, workers, prepare_stopwatch, produce_noted, recycle=10**9)

    return make_dataset(config, out, count, pool)


def prepare_stopwatch() -> None:
    """Prepare a worker and put a stopwatch around mi.render."""
    prepare()
    from mitsuba_endo.rendering.untyped import dr, mi

    real = mi.render

    def render(*arguments: Any, **options: Any) -> Any:
        began = time.perf_counter()
        image = real(*arguments, **options)
        dr.eval(image)
        dr.sync_thread()
        _rendering[0] += time.perf_counter() - began
        return image

    mi.render = render


def produce_noted(job: Job, index: int) -> Result:
    """Make a sample; note how long it rendered and how much memory the process has."""
    before = _rendering[0]
    result = produce(job, index)
    note = {"seconds": result.seconds, "rendering": _rendering[0] - before, "memory": _resident()}
    folder = Path(job.out) / NOTES
    folder.mkdir(exist_ok=True)
    (folder / f"{index:06d}.json").write_text(json.dumps(note))
    return result


def _notes(out: Path) -> list[dict[str, float]]:
    return [json.loads(path.read_text()) for path in sorted((out / NOTES).iterdir())]


def _resident() -> float:
    """Return the resident memory of this process, MB (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
