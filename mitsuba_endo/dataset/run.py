"""Making a dataset: what is there already stays, what is missing is made."""

import contextlib
import json
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Protocol

from filelock import FileLock, Timeout

from ..errors import InputError
from ..files import atomic_path
from ..litter import sweep
from ..reading.trees import read_json
from .asset_cache import clear_assets
from .config import Config
from .contents import Store, numbered
from .digests import array_digest
from .scene_ranges import FILE
from .work import DatasetJob, SampleOutcome

SCHEMA = 1
"""Of dataset.json and manifest.json; changes whenever the meaning of a key does."""
DATASET, MANIFEST, FAILED = "dataset.json", "manifest.json", "failed"
PACKAGES = ("mitsuba-endo", "mitsuba", "drjit", "numpy")
"""Whose versions decide what a sample is."""

Advance = Callable[["Progress"], None]


class Pool(Protocol):
    """Somebody who makes samples."""

    def run(self, indices: Iterable[int]) -> Iterator[SampleOutcome]:
        """Yield a result for every number, in the order of completion."""
        ...


@dataclass(frozen=True)
class Progress:
    """How far a run has come."""

    done: int
    """Samples that exist, those of earlier runs included."""
    failed: int
    count: int
    """Samples wanted."""
    rate: float
    """Samples per second of this run, failed ones included; 0 before the first."""

    @property
    def seconds_left(self) -> float | None:
        """How long the rest takes at this rate; None before the first sample."""
        return (self.count - self.done - self.failed) / self.rate if self.rate else None


def make_dataset(
    config: Config,
    out: str | Path,
    count: int,
    pool: Callable[[DatasetJob], Pool],
    advance: Advance = lambda progress: None,
    retry_failed: bool = False,
) -> Progress:
    """Make samples 0 to count - 1, or those of them that are not yet there.

    Args:
        config: what to draw.
        out: folder; new, empty, or with a dataset begun with the same configuration.
        count: samples wanted; those that fail are recorded and not replaced.
        pool: makes the workers.
        advance: called after every sample.
        retry_failed: whether to try failed samples of earlier runs again.

    Raises:
        InputError: the folder cannot be used or written, it was begun with another
            configuration, or a surface that the user gives is unusable.
    """
    out = Path(out).absolute()
    job = DatasetJob(config, str(out))
    began = _open_folder(out)
    with locked(out):
        try:
            _begin(job, out, count, began)
            return _make_and_list(job, out, count, pool, advance, retry_failed)
        finally:
            clear_assets(job.assets())


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder for this process; the system lets it go whatever ends the process.

    Raises:
        InputError: another process holds it.
    """
    lock = FileLock(folder / ".lock", timeout=0)
    try:
        lock.acquire()
    except Timeout:
        raise InputError(
            "another run is working in this folder", str(folder), "wait for it or stop it"
        ) from None
    try:
        yield
    finally:
        lock.release()


def _make_and_list(
    job: DatasetJob,
    out: Path,
    count: int,
    pool: Callable[[DatasetJob], Pool],
    advance: Advance,
    retry_failed: bool,
) -> Progress:
    """Make what is missing; the manifest lists what is there after an interruption, too."""
    store = job.store()
    store.clear()
    sweep(out)
    sweep(out / FAILED, alone=True)
    if retry_failed:
        for index in numbered(out / FAILED, ".json"):
            _failure(out, index).unlink()
    try:
        progress = _make_missing(job, store, count, pool, advance)
    except BaseException:
        with contextlib.suppress(InputError, OSError):  # the first fault is the one to tell
            _close(store, out)
        raise
    _close(store, out)
    return progress


def _make_missing(
    job: DatasetJob, store: Store, count: int, pool: Callable[[DatasetJob], Pool], advance: Advance
) -> Progress:
    wanted = range(count)
    done = store.indices().intersection(wanted)
    failed = numbered(Path(job.out) / FAILED, ".json").intersection(wanted) - done
    missing = sorted(set(wanted) - done - failed)
    started, before = time.monotonic(), count - len(missing)
    progress = Progress(len(done), len(failed), count, 0.0)
    advance(progress)
    if missing:
        for result in pool(job).run(missing):
            if result.status == "stop":
                raise InputError(
                    f"{result.reason.rstrip('.')}; {len(done)} of {count} samples are kept",
                    todo="make room, then run the same command again to go on",
                )
            if result.status == "done":
                done.add(result.index)
            else:
                failed.add(result.index)
                _record_failure(job, result)
            store.settle(done | failed, last=False)
            rate = (len(done) + len(failed) - before) / (time.monotonic() - started)
            progress = Progress(len(done), len(failed), count, rate)
            advance(progress)
    store.settle(done | failed, last=True)
    return progress


def _record_failure(job: DatasetJob, result: SampleOutcome) -> None:
    record = {"index": result.index, "seed": job.config.seed, "status": result.status,
              "reason": result.reason}  # fmt: skip
    _write_json(_failure(job.out, result.index), record)


def _failure(out: str | Path, index: int) -> Path:
    return Path(out) / FAILED / f"{index:06d}.json"


def failures(out: str | Path) -> list[dict[str, Any]]:
    """Return the records of failed samples."""
    indices = sorted(numbered(Path(out) / FAILED, ".json"))
    return [_failed(_failure(out, index)) for index in indices]


def _failed(path: Path) -> dict[str, Any]:
    record = read_json(path, "remove it")
    if not isinstance(record.get("index"), int) or not isinstance(record.get("reason"), str):
        raise InputError("is no record of a failed sample", str(path), "remove it")
    return record


def _open_folder(out: Path) -> dict[str, Any] | None:
    """Make the folder, or return what it was begun with."""
    if (out / DATASET).is_file():
        return read_json(out / DATASET)
    if out.exists() and not out.is_dir():
        raise InputError("exists and is not a folder", str(out), "choose another output folder")
    if out.is_dir() and any(path.name != ".lock" for path in out.iterdir()):
        raise InputError("holds files that are no dataset", str(out), "choose an empty folder")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(
            f"cannot be made ({reason})", str(out), "choose a folder you may write to"
        ) from error
    return None


def _begin(job: DatasetJob, out: Path, count: int, began: dict[str, Any] | None) -> None:
    """Prepare what samples share, and write down, or compare, what the dataset is made of."""
    job.assets().mkdir(exist_ok=True)
    wanted = {
        "schema": SCHEMA,
        "units": "mm",
        "config": job.config.model_dump(mode="json"),
        "surfaces": _prepare_surfaces(job),
        "versions": {name: metadata.version(name) for name in PACKAGES},
    }
    if began is not None:
        began = {key: value for key, value in began.items() if key != "count"}
        difference = _difference(began, json.loads(json.dumps(wanted)))
        if difference:
            raise InputError(
                f"was begun with another {difference}", str(out / DATASET),
                "choose another folder, or the same settings to go on",
            )  # fmt: skip
    _write_json(out / DATASET, {**wanted, "count": count})


def _prepare_surfaces(job: DatasetJob) -> dict[str, Any]:
    """Check the surfaces that the user gives and keep them for the workers."""
    from .asset_cache import save_mesh, user_mesh_path

    noted = {}
    for number, scene in enumerate(job.config.scenes):
        if scene.kind == FILE:
            from .user_mesh import load_user_mesh, note

            mesh = load_user_mesh(scene)
            save_mesh(user_mesh_path(job.assets(), number), mesh)
            sums = array_digest(mesh.vertices), array_digest(mesh.faces)
            noted[str(number)] = {"file": scene.file, **note(mesh), "sha256": sums}
    return noted


def _difference(a: Any, b: Any, where: str = "") -> str | None:
    """Return the first place at which two JSON values differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in [*a, *(k for k in b if k not in a)]:
            if key not in a or key not in b:
                return f"{where}{key}"
            difference = _difference(a[key], b[key], f"{where}{key}.")
            if difference:
                return difference
        return None
    return None if a == b else where.rstrip(".")


def _close(store: Store, out: Path) -> None:
    """Remove what is half written and list what is there."""
    store.clear()
    record = {"schema": SCHEMA, "samples": store.manifest(), "failed": failures(out)}
    _write_json(out / MANIFEST, record)


def _write_json(path: Path, data: dict[str, Any]) -> None:
    with atomic_path(path) as aside:
        aside.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
