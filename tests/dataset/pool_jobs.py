"""What test workers do instead of making pictures; importable by the processes that do it."""

import os
import signal
import time
from pathlib import Path

from mitsuba_endo.dataset.work import DatasetJob, SampleOutcome


def nothing() -> None:
    """Prepare nothing."""


def note(job: DatasetJob, index: int) -> SampleOutcome:
    """Leave a file for the sample, with the worker's process id."""
    (Path(job.out) / f"{index}-{os.getpid()}").touch()
    return SampleOutcome(index, "done")


def die_on_three(job: DatasetJob, index: int) -> SampleOutcome:
    """As `note`, but sample 3 kills its worker, as a lack of memory would."""
    if index == 3:
        note(job, index)
        os.kill(os.getpid(), signal.SIGKILL)
    return note(job, index)


def die_once_on_three(job: DatasetJob, index: int) -> SampleOutcome:
    """As `note`, but sample 3 kills its worker the first time."""
    if index == 3 and not list(Path(job.out).glob("3-*")):
        note(job, index)
        os.kill(os.getpid(), signal.SIGKILL)
    return note(job, index)


def never_end(job: DatasetJob, index: int) -> SampleOutcome:
    """Work for ever."""
    note(job, index)
    time.sleep(600)
    return SampleOutcome(index, "done")
