from pathlib import Path

import pytest

from mitsuba_endo.dataset.dask_pool import DaskPool
from mitsuba_endo.dataset.run import make_dataset
from mitsuba_endo.errors import InputError
from tests.dataset.small import contents_of, make_here, small_config

distributed = pytest.importorskip("dask.distributed")
# The scheduler's own sockets and event loop are closed late; they are none of ours.
pytestmark = [
    pytest.mark.usefixtures("llvm"),
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def cluster(**options):
    settings = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None,
                "processes": True}  # fmt: skip
    return distributed.LocalCluster(**{**settings, **options})


def test_a_cluster_makes_the_same_samples(tmp_path: Path):
    """Oracle: the bytes made in this process."""
    config = small_config()
    make_here(config, tmp_path / "here", 3)
    with cluster() as there:
        address = there.scheduler_address
        done = make_dataset(config, tmp_path / "there", 3, lambda job: DaskPool(job, address))
    assert done.done == 3
    assert contents_of(tmp_path / "there") == contents_of(tmp_path / "here")


def test_clusters_that_cannot_do_it_are_refused(tmp_path: Path):
    """Oracle: a worker of two threads, no worker, no scheduler."""

    def attempt(address: str) -> None:
        make_dataset(small_config(), tmp_path / "out", 1, lambda job: DaskPool(job, address))

    with (
        cluster(threads_per_worker=2, processes=False) as there,
        pytest.raises(InputError, match="start them with --nthreads 1"),
    ):
        attempt(there.scheduler_address)
    with (
        cluster(n_workers=0, processes=False) as there,
        pytest.raises(InputError, match="has no workers"),
    ):
        attempt(there.scheduler_address)
    with pytest.raises(InputError, match=r"--dask: no Dask scheduler answers"):
        attempt("tcp://127.0.0.1:9")
