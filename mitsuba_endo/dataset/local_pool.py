"""Worker processes on this machine."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from ..interrupts import uninterrupted
from .work import DatasetJob, SampleOutcome, prepare, produce

RETRIES = 1
"""Times a sample is tried again whose worker was killed."""
RECYCLE = 250
"""Samples after which a worker is replaced: Mitsuba keeps a little memory of every scene."""
PATIENCE_S = 5.0
"""Seconds that a worker has to end by itself: a render of a usual sample takes less."""


@dataclass(eq=False)
class _Worker:
    process: Any
    connection: Any
    left: int
    """Samples until it is replaced."""
    index: int | None = None
    """The sample it works on."""


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class LocalPool:
    """Processes that make samples; one that dies is replaced and its sample tried again."""

    def __init__(
        self,
        job: DatasetJob,
        workers: int,
        prepare: Callable[[], None] = prepare,
        produce: Callable[[DatasetJob, int], SampleOutcome] = produce,
        recycle: int = RECYCLE,
    ) -> None:
        """Describe the workers; they start when there is work.

        Args:
            job: what is to be made.
            workers: how many processes.
            prepare: what each does first; importable by name, as is ``produce``.
            produce: makes one sample.
            recycle: samples after which a worker is replaced.
        """
        self._count, self._recycle = workers, recycle
        self._arguments = job, prepare, produce
        self._context = multiprocessing.get_context("spawn")
        self._workers: list[_Worker] = []

    def run(self, indices: Iterable[int]) -> Iterator[SampleOutcome]:
        """Yield a result for every number, in the order of completion.

        All processes are gone when the iteration ends, also by an exception.
        """
        waiting, deaths = deque(indices), dict[int, int]()
        try:
            while waiting or any(w.index is not None for w in self._workers):
                self._assign(waiting)
                yield from self._collect(waiting, deaths)
        finally:
            self._stop()

    def _assign(self, waiting: deque[int]) -> None:
        """Give every idle worker a sample, starting workers as needed."""
        while len(self._workers) < min(self._count, len(waiting) + self._busy()):
            self._workers.append(self._start())
        for worker in self._workers:
            if worker.index is None and waiting:
                worker.index = waiting.popleft()
                try:
                    worker.connection.send(worker.index)
                except OSError:  # it died while idle; _collect takes its sample back
                    continue

    def _busy(self) -> int:
        return sum(worker.index is not None for worker in self._workers)

    def _collect(self, waiting: deque[int], deaths: dict[int, int]) -> Iterator[SampleOutcome]:
        """Wait until a worker reports or dies."""
        handles = {worker.connection: worker for worker in self._workers}
        for ready in multiprocessing.connection.wait(list(handles)):
            worker = handles[ready]
            try:
                result = worker.connection.recv()
            except (EOFError, OSError):
                lost = self._bury(worker, waiting, deaths)
                if lost is not None:
                    yield lost
                continue
            worker.index = None
            worker.left -= 1
            if worker.left == 0:
                self._dismiss(worker)
            yield result

    def _bury(
        self, worker: _Worker, waiting: deque[int], deaths: dict[int, int]
    ) -> SampleOutcome | None:
        """Forget a dead worker; its sample goes to the front of the queue or is given up."""
        self._workers.remove(worker)
        worker.process.join()
        worker.connection.close()
        index = worker.index
        if index is None:
            return None
        deaths[index] = deaths.get(index, 0) + 1
        if deaths[index] <= RETRIES:
            waiting.appendleft(index)
            return None
        code = worker.process.exitcode
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        reason = f"its worker was killed {deaths[index]} times ({how}); is there enough memory?"
        return SampleOutcome(index, "killed", reason)

    def _start(self) -> _Worker:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, *self._arguments), daemon=True)
        with uninterrupted():  # a child that is half started prints a traceback
            process.start()
        theirs.close()  # so that its end is noticed on ours
        return _Worker(process, ours, self._recycle)

    def _dismiss(self, worker: _Worker) -> None:
        """Let an idle worker end by itself."""
        self._workers.remove(worker)
        worker.connection.close()

    def _stop(self) -> None:
        for worker in self._workers:
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join(PATIENCE_S)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()
            worker.connection.close()
        self._workers.clear()


def _end_with_parent() -> None:
    """End this process as soon as the one that started it is gone, in the middle of a sample.

    It would write on for seconds while another run has the folder.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


def _serve(
    connection: Any,
    job: DatasetJob,
    prepare: Callable[[], None],
    produce: Callable[[DatasetJob, int], SampleOutcome],
) -> None:
    """Make the samples whose numbers come in, until the other end closes."""
    # Ctrl-C reaches the whole group; the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    prepare()
    while True:
        try:
            index = connection.recv()
        except (EOFError, OSError):  # dismissed, or the parent is gone
            return
        result = produce(job, index)
        try:
            connection.send(result)
        except OSError:
            return
