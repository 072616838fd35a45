"""Solving in processes of their own that are refused every file of the truth."""

import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from .capture import TRUTH

Task = TypeVar("Task")
Result = TypeVar("Result")


def refuse_truth() -> None:
    """Make this process unable to open any file below a folder of truth, for good."""
    sys.addaudithook(_refuse)


def _refuse(event: str, arguments: tuple) -> None:
    if event != "open" or not isinstance(arguments[0], str | bytes | os.PathLike):
        return
    if TRUTH in Path(os.fsdecode(arguments[0])).parts:
        raise PermissionError(f"a solver asked for the truth: {os.fsdecode(arguments[0])}")


def _begin() -> None:
    refuse_truth()
    from mitsuba_endo import backend

    backend.use("llvm_ad_rgb")


@contextmanager
def solvers(workers: int = 2) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that cannot read the truth.

    They are spawned, not forked: nothing that the parent knows is in their memory.
    """
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_begin) as pool:
        yield pool


def answer(job: Future[Result]) -> Result | None:
    """Return a job's result; None, and a line on the screen, where the method gives up.

    Only what methods say about data (input errors are ValueErrors) is an answer: a truth that was
    asked for, and mistakes of the program, end the run.
    """
    try:
        return job.result()
    except (RuntimeError, ValueError) as error:
        print(f"gave up: {error}", flush=True)
        return None


def solve_each(
    method: Callable[[Task], Result], tasks: Iterable[Task], workers: int = 2
) -> list[Result]:
    """Return the method's result for every task, in order; the work is spread over processes."""
    with solvers(workers) as pool:
        return list(pool.map(method, tasks))
