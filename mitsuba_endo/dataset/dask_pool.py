"""Workers of a Dask cluster that is already there."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from ..errors import InputError
from .work import DatasetJob, SampleOutcome, prepare, produce

AHEAD = 2
"""Samples handed out per worker: one being made and one waiting."""
CONNECT_S = 5
"""Seconds in which a scheduler must answer: one on the network does within one."""


class DaskPool:
    """Every worker of a cluster; they must see the dataset's folder under the same path."""

    def __init__(self, job: DatasetJob, address: str) -> None:
        self._job, self._client = job, _connect(address)
        self._workers = self._check(address)

    def run(self, indices: Iterable[int]) -> Iterator[SampleOutcome]:
        """Yield a result for every number, in the order of completion."""
        from dask.distributed import as_completed  # pyright: ignore[reportMissingImports]

        waiting = iter(indices)
        running: dict[Any, int] = {}
        completed = as_completed()

        def hand_out() -> None:
            index = next(waiting, None)
            if index is not None:
                future = self._client.submit(_produce, self._job, index, pure=False)
                running[future] = index
                completed.add(future)

        try:
            for _ in range(AHEAD * self._workers):
                hand_out()
            for future in completed:
                index = running.pop(future)
                yield _result(future, index)
                hand_out()
        finally:
            self._client.cancel(list(running))
            self._client.close()

    def _check(self, address: str) -> int:
        """Return the number of workers, each of which has one thread and sees the folder."""
        threads = self._client.nthreads()
        if not threads:
            self._fail("has no workers", address, "start some")
        if max(threads.values()) > 1:
            self._fail(
                "has workers of several threads, in which Mitsuba cannot start", address,
                "start them with --nthreads 1",
            )  # fmt: skip
        marker = self._job.assets()
        visible = self._client.run(Path.is_dir, marker)
        blind = [worker for worker, sees in visible.items() if not sees]
        if blind:
            self._fail(
                f"its worker {blind[0]} does not see the folder", self._job.out,
                "choose one on a file system that all workers share",
            )  # fmt: skip
        return len(threads)

    def _fail(self, what: str, where: str, todo: str) -> None:
        self._client.close()
        raise InputError(what, where, todo)


def _connect(address: str) -> Any:
    try:
        from dask.distributed import Client  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            "a cluster needs the package dask", "--dask", 'pip install "mitsuba-endo[dataset]"'
        ) from None
    try:
        return Client(address, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"no Dask scheduler answers ({error})", "--dask", "check the address"
        ) from None


def _produce(job: DatasetJob, index: int) -> SampleOutcome:
    """Make a sample on a worker, which stays prepared from its first sample on."""
    import sys

    if "drjit" not in sys.modules or sys.modules["drjit"].thread_count() != 1:
        prepare()
    return produce(job, index)


def _result(future: Any, index: int) -> SampleOutcome:
    """Return what the worker returned, or that it died (Dask itself has tried it elsewhere)."""
    error = future.exception()
    if error is None:
        return future.result()
    return SampleOutcome(index, "killed", f"its worker was lost ({type(error).__name__}: {error}).")
