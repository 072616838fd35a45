"""What the system does to a command: full disk, no memory, read-only place, two at once, signals.

Oracle: one sentence, the documented exit code, and the files before and after.
"""

import contextlib
import errno
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mitsuba_endo import litter
from mitsuba_endo.cli import faults
from mitsuba_endo.files import atomic_folder, atomic_path
from mitsuba_endo.folder_mark import Kind, files_in, read_mark
from mitsuba_endo.litter import aside_of, scratch_folder, sweep
from mitsuba_endo.outputs import prepare_folder
from scripts.reliability.commands import RUN
from tests.cli.inputs import run
from tests.reliability.results import contents, write_inputs, write_result

resource = pytest.importorskip("resource")
linux = pytest.mark.skipif(sys.platform != "linux", reason="Linux tells and limits memory")


def _limited(folder: Path, kind: int, limit: int, *arguments: object) -> tuple[int, str]:
    """Run a command in a folder under a limit of the system; return its exit code and stderr."""
    done = subprocess.run(
        [*RUN, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=120,
        preexec_fn=lambda: resource.setrlimit(kind, (limit, limit)),
    )  # fmt: skip
    return done.returncode, done.stderr


WRITERS = {
    "patterns": ("patterns", "--pattern", "gray", "--width", 800, "--height", 600, "--out", "out"),
    "report": ("report", "calibrated", "--out", "out.html"),
    "evaluate": ("evaluate", "result", "--truth", "truth/truth.json", "--out", "out.json"),
    "export ply": ("export", "result", "--format", "ply", "--out", "out.ply"),
    "export opencv": ("export", "result", "--format", "opencv", "--out", "out.yml"),
    "export colmap": ("export", "result", "--format", "colmap", "--out", "out"),
    "export mitsuba": ("export", "result", "--format", "mitsuba", "--out", "out"),
    "render": ("render", "plane", "--spp", 1, "--out", "out"),
    "dataset": ("dataset", "--out", "out", "--count", 1, "--workers", 1),
}
"""Commands that write, and what they write more of than the limit below."""
NO_ROOM = {"report": 30_000, "patterns": 500, "render": 30_000, "dataset": 100}
"""Bytes that a file may have; by default less than any file of the command."""


@pytest.fixture
def base(tmp_path: Path) -> Path:
    write_result(tmp_path / "result")
    write_result(tmp_path / "truth", "truth.json")
    return write_inputs(tmp_path)


@pytest.mark.usefixtures("llvm")
@pytest.mark.parametrize("name", WRITERS)
def test_full_disk(base: Path, name: str, request: pytest.FixtureRequest):
    """A limit on the size of files is met as a full disk is, by the same functions."""
    if name == "report":
        from mitsuba_endo.show.solution_folder import write_solution_folder
        from scripts.reliability.made_up import made_up

        write_solution_folder(base / "calibrated", made_up())
    before = contents(base)
    limit = NO_ROOM.get(name, 50)
    code, said = _limited(base, resource.RLIMIT_FSIZE, limit, *WRITERS[name])
    assert code == 2, said
    assert said.count("\n") == 1
    assert "make room" in said or "disk is full" in said, said
    after = {k: v for k, v in contents(base).items() if not k.startswith("out/")}
    assert after == before
    left = [p for p in base.rglob("*") if ".endo-" in p.name]
    assert not left


@linux
@pytest.mark.parametrize("mib", [150, 300, 450, 550, 700, 900, 1000, 1100, 1200])
def test_little_memory(tmp_path: Path, mib: int):
    """Between what is enough and what is not: no signal, no internal fault, no wait."""
    arguments = ("render", "plane", "--spp", 1, "--out", "out", "--set", "width=64")
    code, said = _limited(tmp_path, resource.RLIMIT_AS, mib << 20, *arguments)
    assert code in (0, faults.EXIT_MEMORY), said
    assert code == 0 or said == f"error: {faults.SHORT}\n"
    assert (code == 0) == (tmp_path / "out").exists()


@linux
def test_no_threads(tmp_path: Path):
    """Oracle: the limit on processes of a user other than root; root has none."""
    assert faults.sentence(RuntimeError("can't start new thread")) == (faults.SHORT, 71)
    assert faults.sentence(MemoryError()) == (faults.SHORT, 71)
    assert faults.sentence(ValueError("something else")) is None


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EDQUOT])
def test_what_the_system_says_is_a_sentence(number: int):
    told = faults.sentence(OSError(number, os.strerror(number), "some/file"))
    assert told is not None
    assert told[0].startswith("some/file: the system says ")
    assert told[1] == 2


@pytest.mark.parametrize("command", ["report", "evaluate"])
def test_read_only_place(base: Path, monkeypatch: pytest.MonkeyPatch, command: str):
    """Neither writing nor clearing away is possible: the first fault is the one that is told."""

    def refuse(self: Path, *arguments: object, **options: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(self))

    monkeypatch.setattr(Path, "touch", refuse)
    monkeypatch.setattr(Path, "unlink", refuse)
    if command == "report":
        with (
            pytest.raises(ValueError, match=r"read-only file system"),
            atomic_path(base / "a.html"),
        ):
            pass
        return
    result = run("evaluate", base / "result", "--truth", base / "truth", "--out", base / "m.json")
    assert result.exit_code == 2
    assert "m.json: cannot be written (read-only file system); choose a folder" in result.stderr


def test_two_writers_of_one_folder(tmp_path: Path):
    """Oracle: whoever is last, the folder is complete; none fails for ever or leaves litter."""
    failed: list[BaseException] = []

    def write(k: int) -> None:
        try:
            for i in range(25):
                with atomic_folder(tmp_path / "out", Kind.MAPS) as folder:
                    for name in ("a.txt", "b.txt"):
                        (folder / name).write_text(f"{k} {i}")
        except BaseException as error:
            failed.append(error)

    threads = [threading.Thread(target=write, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert not failed
    out = tmp_path / "out"
    assert (out / "a.txt").read_text() == (out / "b.txt").read_text()
    mark = read_mark(out)
    assert mark is not None
    assert files_in(out) == mark.files == {"a.txt", "b.txt"}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_two_writers_of_one_file(tmp_path: Path):
    """Oracle: one of the texts, whole."""
    texts = [f"{k}" * 200_000 for k in range(4)]

    def write(text: str) -> None:
        for _ in range(20):
            with atomic_path(tmp_path / "a.txt") as aside:
                aside.write_text(text)

    threads = [threading.Thread(target=write, args=(text,)) for text in texts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert (tmp_path / "a.txt").read_text() in texts
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


@contextlib.contextmanager
def _as_process(monkeypatch: pytest.MonkeyPatch, pid: int):
    with monkeypatch.context() as patch:
        patch.setattr(litter.os, "getpid", lambda: pid)
        yield


def _dead_pid() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_only_what_dead_processes_left_is_removed(tmp_path: Path, monkeypatch):
    """Oracle: names made as by a dead process, a living one, another machine; and others' files."""
    made: dict[str, Path] = {}
    with _as_process(monkeypatch, _dead_pid()):
        made["dead file"] = aside_of(tmp_path / "a.html", "partial")
        made["dead folder"] = aside_of(tmp_path / "out", "partial")
    made["living"] = aside_of(tmp_path / "a.html", "partial")
    with monkeypatch.context() as patch:
        patch.setattr(litter, "_machine", lambda: "another1")
        made["elsewhere"] = aside_of(tmp_path / "a.html", "partial")
    made["mine"] = tmp_path / ".a.partial.html"
    for name, path in made.items():
        path.mkdir() if name == "dead folder" else path.write_text(name)
    removed = sweep(tmp_path)
    assert set(removed) == {made["dead file"], made["dead folder"]}
    assert {p for p in made.values() if p.exists()} == set(made.values()) - set(removed)
    assert set(sweep(tmp_path, alone=True)) == {made["living"], made["elsewhere"]}
    assert [p.name for p in tmp_path.iterdir()] == [".a.partial.html"]


@pytest.mark.parametrize("replaced", [False, True])
def test_a_result_that_was_moved_aside_comes_back(tmp_path: Path, monkeypatch, replaced: bool):
    """Killed between two renames: the older result comes back unless the new one took its place."""
    with atomic_folder(tmp_path / "out", Kind.MAPS) as folder:
        (folder / "a.txt").write_text("old")
    with _as_process(monkeypatch, _dead_pid()):
        (tmp_path / "out").rename(aside_of(tmp_path / "out", "old"))
    if replaced:
        with atomic_folder(tmp_path / "out", Kind.MAPS) as folder:
            (folder / "a.txt").write_text("new")
    prepare_folder(tmp_path / "out", Kind.MAPS)
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert (tmp_path / "out" / "a.txt").read_text() == ("new" if replaced else "old")


def test_scratch_folders_of_dead_processes_are_removed(tmp_path: Path, monkeypatch):
    """Oracle: the temporary folder before and after."""
    monkeypatch.setattr(litter.tempfile, "tempdir", str(tmp_path))
    with _as_process(monkeypatch, _dead_pid()):
        left = aside_of(tmp_path / "mitsuba-endo", "partial")
    left.mkdir()
    (left / "map.exr").touch()
    with scratch_folder() as folder:
        assert list(tmp_path.iterdir()) == [folder]
    assert not list(tmp_path.iterdir())


def test_doctor_removes_what_was_left(tmp_path: Path, monkeypatch):
    from mitsuba_endo.cli import doctor

    monkeypatch.chdir(tmp_path)
    with _as_process(monkeypatch, _dead_pid()):
        left = aside_of(tmp_path / "out", "partial")
    left.mkdir()
    assert doctor._leftovers().found.startswith("removed ")
    assert not left.exists()


@pytest.mark.parametrize("length", [10, 200, 251, 255])
def test_long_names_are_written(tmp_path: Path, length: int):
    path = tmp_path / ("n" * (length - 4) + ".txt")
    with atomic_path(path) as aside:
        aside.write_text("x")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("name", ["n" * 256, "é" * 130, "a\0b"])
def test_names_that_no_system_takes(tmp_path: Path, name: str):
    for write in (lambda p: atomic_path(p), lambda p: atomic_folder(p, Kind.MAPS)):
        with pytest.raises(ValueError, match="choose a"), write(tmp_path / name):
            pass
    assert not list(tmp_path.iterdir())


def _sleep(pipe: Path) -> None:
    """Be a main process with one worker of a dataset that takes for ever."""
    from mitsuba_endo.dataset.config import Config
    from mitsuba_endo.dataset.local_pool import LocalPool
    from mitsuba_endo.dataset.work import DatasetJob
    from tests.dataset import pool_jobs

    job = DatasetJob(Config(), str(pipe.parent))
    list(LocalPool(job, 1, pool_jobs.nothing, pool_jobs.never_end).run([0]))


@linux
def test_workers_end_with_a_killed_main(tmp_path: Path):
    """Oracle: the system's list of processes; a worker whose main lives would never end.

    On a free machine they end within two seconds; how long to wait decides nothing.
    """
    context = multiprocessing.get_context("spawn")
    main = context.Process(target=_sleep, args=(tmp_path / "x",))
    main.start()
    assert main.pid is not None
    workers = _wait_for(lambda: _children(main.pid))
    _wait_for(lambda: list(tmp_path.glob("0-*")))
    os.kill(main.pid, signal.SIGKILL)
    main.join()
    _wait_for(lambda: not any(Path(f"/proc/{pid}/cmdline").exists() for pid in workers))


def _children(pid: int | None) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [c for c in map(int, text.split())
            if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]  # fmt: skip


def _wait_for(found: Callable[[], Any], seconds: float = 60.0) -> Any:
    deadline = time.monotonic() + seconds
    while not (value := found()):
        assert time.monotonic() < deadline, "in vain"
        time.sleep(0.02)
    return value
