import os
import time
from pathlib import Path

import pytest

from mitsuba_endo.dataset.local_pool import LocalPool
from mitsuba_endo.dataset.work import DatasetJob
from tests.dataset import pool_jobs
from tests.dataset.small import small_config


def pool(folder: Path, produce, workers: int = 2, recycle: int = 100) -> LocalPool:
    job = DatasetJob(small_config(), str(folder))
    return LocalPool(job, workers, pool_jobs.nothing, produce, recycle)


def made(folder: Path) -> dict[int, list[int]]:
    """Return the process ids that worked on each sample."""
    found: dict[int, list[int]] = {}
    for path in folder.iterdir():
        index, process = path.name.split("-")
        found.setdefault(int(index), []).append(int(process))
    return found


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_every_sample_is_made_once_by_processes_that_are_replaced(tmp_path: Path):
    """Oracle: each worker leaves a file for each sample; 7 samples at 2 a worker need 4 workers."""
    results = list(pool(tmp_path, pool_jobs.note, recycle=2).run(range(7)))
    assert sorted(r.index for r in results) == list(range(7))
    assert {r.status for r in results} == {"done"}
    processes = [process for ids in made(tmp_path).values() for process in ids]
    assert len(processes) == 7
    assert len(set(processes)) >= 4
    assert os.getpid() not in processes


def test_a_sample_whose_worker_dies_twice_is_given_up_and_the_others_are_made(tmp_path: Path):
    """Oracle: sample 3 kills its worker each time; the files tell how often it was tried."""
    results = {r.index: r for r in pool(tmp_path, pool_jobs.die_on_three).run(range(6))}
    assert sorted(results) == list(range(6))
    assert results[3].status == "killed"
    assert "signal 9" in results[3].reason
    assert all(results[i].status == "done" for i in (0, 1, 2, 4, 5))
    assert {index: len(ids) for index, ids in made(tmp_path).items()}[3] == 2


def test_a_sample_whose_worker_dies_once_is_made(tmp_path: Path):
    """Oracle: as above, but the second worker lives."""
    results = {r.index: r for r in pool(tmp_path, pool_jobs.die_once_on_three).run(range(5))}
    assert {r.status for r in results.values()} == {"done"}
    assert len(results) == 5


def test_leaving_the_iteration_ends_the_workers(tmp_path: Path):
    """Oracle: the operating system knows no process of theirs any more."""
    run = pool(tmp_path, pool_jobs.die_on_three).run(range(3))
    next(run)
    run.close()
    assert not any(alive(process) for ids in made(tmp_path).values() for process in ids)


def test_interrupting_ends_workers_in_the_middle_of_a_sample(tmp_path: Path):
    """Oracle: samples would take ten minutes; Ctrl-C must not wait for them."""
    run = pool(tmp_path, pool_jobs.never_end)

    def interrupted(*arguments):
        deadline = time.monotonic() + 60
        while len(made(tmp_path)) < 2 and time.monotonic() < deadline:
            time.sleep(0.02)
        raise KeyboardInterrupt

    run._collect = interrupted  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(KeyboardInterrupt):
        list(run.run(range(4)))
    processes = [process for ids in made(tmp_path).values() for process in ids]
    assert len(processes) == 2
    assert not any(alive(process) for process in processes)
