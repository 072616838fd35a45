"""Making a dataset of 1,000 samples: throughput against bare rendering, time, memory."""

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
from mitsuba_endo.dataset.work import DatasetJob, SampleOutcome, prepare, produce

from .report import Figure, timed

NAME = "dataset"
_figure = partial(Figure, NAME)
WORKERS = 2
WARM = 50
"""Samples after which a worker's memory should stay as it is."""
NOTES = "notes"
TINY: dict[str, Any] = {"camera": {"width": 96, "height": 72}, "capture": {"spp": 2}}
_rendering = [0.0]
"""Seconds spent in mi.render by this process, in a list so that the wrapper can add to it."""


def run(quick: bool) -> list[Figure]:
    """Make samples as the command does, with a stopwatch around every mi.render.

    One run gives all figures: 1,000 samples at the built-in settings (320 x 240 pixels, 16 samples
    a pixel), in shards as for training, by two workers that are never replaced, so that each
    makes about 500. It takes half an hour on two quiet cores.
    """
    config = Config.model_validate({"format": "hdf5", **(TINY if quick else {})})
    count = 24 if quick else 1000
    with tempfile.TemporaryDirectory() as folder:
        seconds, made = timed(lambda: _make(config, Path(folder) / "made", count))
        notes = _notes(Path(folder) / "made")
    figures = [*_throughput(notes, seconds, made, quick), *_memory(notes, quick)]
    return [*figures, _figure("failed samples", made.failed, "", "lower")]


def _throughput(
    notes: list[dict[str, float]], seconds: float, made: Progress, quick: bool
) -> list[Figure]:
    rendering = sum(note["rendering"] for note in notes)
    working = sum(note["seconds"] for note in notes)
    ratio = None if quick else 0.85
    return [
        _figure(f"rendering by workers' time, start to end ({made.done} samples)",
                rendering / (WORKERS * seconds), "ratio", "higher", ratio),
        _figure("rendering by samples' time", rendering / working, "ratio", "higher", ratio),
        _figure("beside rendering", (working - rendering) / len(notes), "s a sample", "lower"),
        _figure(f"samples by {WORKERS} workers", 60 * made.done / seconds, "per minute", "higher"),
        _figure(f"{made.done:,} samples", seconds / 60, "min", "lower", None if quick else 60),
    ]  # fmt: skip


def _memory(notes: list[dict[str, float]], quick: bool) -> list[Figure]:
    """Compare each worker's last samples with those after which its memory should stay."""
    figures = []
    for number, worker in enumerate(sorted({note["worker"] for note in notes}), 1):
        own = sorted((n for n in notes if n["worker"] == worker), key=lambda n: n["order"])
        sizes = [note["memory"] for note in own]
        warm = min(WARM, len(sizes) // 2)
        span = warm // 2
        growth = 100 * (np.mean(sizes[-span:]) / np.mean(sizes[warm : warm + span]) - 1)
        figures += [
            _figure(f"worker {number}, memory after {len(sizes)} samples by that after {warm}",
                    float(growth), "% more", "lower", None if quick else 10),
            _figure(f"worker {number}, memory", sizes[-1], "MB", "lower"),
        ]  # fmt: skip
    return figures


def _make(config: Config, out: Path, count: int) -> Progress:
    def pool(job: DatasetJob) -> LocalPool:
        return LocalPool(job, WORKERS, prepare_stopwatch, produce_noted, recycle=10**9)

    return make_dataset(config, out, count, pool)


def prepare_stopwatch() -> None:
    """Prepare a worker and put a stopwatch around mi.render."""
    prepare()
    from mitsuba_endo.rendering.mitsuba_modules import dr, mi

    real = mi.render

    def render(*arguments: Any, **options: Any) -> Any:
        began = time.perf_counter()
        image = real(*arguments, **options)
        dr.eval(image)
        dr.sync_thread()
        _rendering[0] += time.perf_counter() - began
        return image

    mi.render = render


def produce_noted(job: DatasetJob, index: int) -> SampleOutcome:
    """Make a sample; note how long it rendered and how much memory the process has."""
    before = _rendering[0]
    result = produce(job, index)
    note = {"seconds": result.seconds, "rendering": _rendering[0] - before,
            "memory": _resident(), "worker": os.getpid(), "order": time.monotonic()}  # fmt: skip
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
