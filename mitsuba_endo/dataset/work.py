"""What a worker does: make one sample and store it."""

import errno
import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Literal

from .. import backend
from ..errors import InputError
from ..interrupts import as_interrupts
from .asset_cache import AssetCache
from .config import Config
from .contents import Store
from .folder_store import FolderStore
from .sample import make_sample
from .shard_store import ShardStore

ASSETS = ".workshop"
"""Folder of what samples share, while a run lasts."""
VARIANT = "llvm_ad_rgb"
"""A GPU adds light in another order at each run, so that samples would never be the same twice."""


@dataclass(frozen=True, eq=False)
class DatasetJob:
    """What is to be made, and where; sent to every worker."""

    config: Config
    out: str
    """The dataset's folder, absolute."""

    def store(self) -> Store:
        """Return the place for the samples."""
        if self.config.format == "hdf5":
            return ShardStore(self.out, self.config.shard)
        return FolderStore(self.out)

    def assets(self) -> Path:
        """Return the folder of what samples share, which is removed at the end."""
        return Path(self.out) / ASSETS


@dataclass(frozen=True)
class SampleOutcome:
    """How the work on one sample ended."""

    index: int
    status: Literal["done", "failed", "killed", "stop"]
    """``killed``: the worker died; ``stop``: nothing can be written, so that no sample can."""
    reason: str = ""
    seconds: float = 0.0
    kind: str = ""


def prepare() -> None:
    """Start Mitsuba on one thread, as every worker does once."""
    import cv2
    from threadpoolctl import threadpool_limits

    backend.use(VARIANT)
    from ..rendering.mitsuba_modules import dr

    # Workers share the cores among themselves, and one thread adds up light in one order. The
    # deadlock of EXR files with one thread concerns Mitsuba's own reading, which workers never do.
    dr.set_thread_count(1)
    threadpool_limits(1)
    cv2.setNumThreads(1)


def produce(job: DatasetJob, index: int) -> SampleOutcome:
    """Make a sample and store it; whatever goes wrong with it becomes part of the result."""
    started = time.perf_counter()
    store = job.config.store
    try:
        with as_interrupts():
            sample = make_sample(job.config, index, _asset_cache(job))
        job.store().write(sample, store.radiance, store.surface)
    except InputError as error:
        status = "stop" if isinstance(error.__cause__, OSError) else "failed"
        return SampleOutcome(index, status, str(error), time.perf_counter() - started)
    except OSError as error:
        status = "stop" if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) else "failed"
        return SampleOutcome(index, status, f"{error}.", time.perf_counter() - started)
    except Exception as error:  # one sample's fault, recorded with its seed, must not end the run
        reason = f"internal fault ({type(error).__name__}: {error})."
        return SampleOutcome(index, "failed", reason, time.perf_counter() - started)
    return SampleOutcome(index, "done", "", time.perf_counter() - started, sample.kind)


@lru_cache(maxsize=1)
def _asset_cache(job: DatasetJob) -> AssetCache:
    return AssetCache(job.config, job.assets())
