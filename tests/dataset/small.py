"""A dataset whose samples take a tenth of a second each."""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from mitsuba_endo import backend
from mitsuba_endo.dataset.config import Config
from mitsuba_endo.dataset.run import Progress, make_dataset
from mitsuba_endo.dataset.work import DatasetJob, SampleOutcome, produce
from mitsuba_endo.records.validation import validate

SHEET = {
    "kind": "bumpy_sheet",
    "parameters": {"distance": [40, 60], "width": 110, "height": 100, "edge": 4, "radius": 120},
}


def small_config(**changes: Any) -> Config:
    """Return a configuration of coarse sheets and tiny pictures."""
    data = {
        "seed": 3,
        "shard": 4,
        "scenes": [SHEET],
        "camera": {"width": 40, "height": 30, "fov": [50, 60]},
        "pattern": {"variants": 2, "columns": 12, "rows": 10, "width": 160, "height": 130,
                    "oversample": 1},
        "projector": {"focal": [130, 150]},
        "capture": {
            "spp": 1, "max_depth": 2, "light": {},
            "tissue": {"subsurface": "none", "vessel_contrast": 0, "relief": 0},
        },
    }  # fmt: skip
    return validate(Config, {**data, **changes}, "config.yaml")


class InThisProcess:
    """A pool without processes."""

    def __init__(
        self, job: DatasetJob, produce: Callable[[DatasetJob, int], SampleOutcome] = produce
    ) -> None:
        self._job, self._produce = job, produce

    def run(self, indices: Iterable[int]) -> Iterator[SampleOutcome]:
        backend.ensure()
        for index in indices:
            with one_thread():
                result = self._produce(self._job, index)
            yield result


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Let Dr.Jit use one thread, as in a worker; other tests would read EXR files for ever."""
    from mitsuba_endo.rendering.mitsuba_modules import dr

    before = dr.thread_count()
    dr.set_thread_count(1)
    try:
        yield
    finally:
        dr.set_thread_count(before)


def make_here(config: Config, out: Path, count: int, **options: Any) -> Progress:
    """Make a dataset in this process."""
    return make_dataset(config, out, count, InThisProcess, **options)


def contents_of(folder: Path) -> dict[str, bytes]:
    """Return every file of the samples by its path in the folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for part in ("samples", "shards", "staging", "failed")
        for path in sorted((folder / part).rglob("*"))
        if path.is_file()
    }
