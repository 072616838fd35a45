"""Kill commands at random moments, and look at what they leave.

python -m scripts.reliability_kills --kills 100 --seed 1 --out kills-output

Wanted: whatever signal comes when, an output is absent, the old one, or complete; Ctrl-C and
SIGTERM end with code 130 and leave nothing half written; after the next run nothing is left over of
SIGKILL either. A dataset is killed as a whole and by one of its workers. What a sequence keeps
beside its output is absent or complete, and it goes on from there to the surface of one that was
not killed.
"""

import os
import shutil
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from mitsuba_endo.folder_mark import files_in, read_mark
from scripts.reliability.choice import chosen_by
from scripts.reliability.commands import COMMANDS, DATASET, Command, run, start
from scripts.reliability.sound import VARIABLE

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
PATIENCE_S = 60.0
"""After a signal, until the process must be gone; a long step of a library ends first."""
EARLIEST_S = 0.3
LITTER = ("*.endo-*", "*.partial*", "*.old")
INTERRUPTED = 130
SURFACE = "mesh.ply"
"""Of a sequence's folder."""
Option = typer.Option


class Patient:
    """A command with its inputs, which is killed again and again."""

    def __init__(self, command: Command, folder: Path) -> None:
        self.command, self.folder, self.faults = command, folder, list[str]()
        folder.mkdir(parents=True)
        command.prepare(folder)
        started = time.monotonic()
        run(folder, *command.arguments, program=command.program)
        self.seconds = time.monotonic() - started
        self.whole = contents(folder / command.out)

    def kill(self, rng: np.random.Generator) -> bool:
        """Start the command, send a signal at some moment; tell whether it was alive then."""
        if rng.random() < 0.5:
            self._forget()
        before = contents(self.folder / self.command.out)
        number = SIGNALS[int(rng.integers(len(SIGNALS)))]
        arguments = self.command.arguments_in(self.folder)
        process = start(self.folder, arguments, self.command.program)
        # Half of them near the end, where the writing is.
        first = EARLIEST_S if rng.random() < 0.5 else 0.7 * self.seconds
        moment = rng.uniform(first, self.seconds)
        time.sleep(moment)
        alive = process.poll() is None
        victims = _children(process.pid) if self._is_dataset and rng.random() < 0.4 else []
        worker = bool(victims) and alive
        if worker:
            os.kill(victims[int(rng.integers(len(victims)))], signal.SIGKILL)
        elif alive:
            process.send_signal(number)
        try:
            _, said = process.communicate(timeout=PATIENCE_S + 2 * self.seconds)
        except Exception:
            process.kill()
            process.communicate()
            self.faults.append(f"{number.name} at {moment:.2f} s: still there")
            return alive
        how = f"{'worker' if worker else number.name} at {moment:.2f} s"
        self._look(how, process.returncode, said, before, alive and not worker, number)
        return alive

    def end(self) -> None:
        """Run the command once more, or let it go on, and see that nothing is left over."""
        arguments = self.command.arguments_in(self.folder)
        run(self.folder, *arguments, program=self.command.program)
        left = leftovers(self.folder)
        if self._beside is not None and self._beside.exists():
            left.append(self._beside.name)
        if left:
            self.faults.append(f"left over after the next run: {left}")
        if self._is_dataset:
            now = contents(self.folder / self.command.out)
            other = [k for k in {*now, *self.whole} if now.get(k) != self.whole.get(k)]
            if other:
                self.faults.append(f"differs from the uninterrupted one in {sorted(other)[:5]}")

        self._compare_surface()

    def _compare_surface(self) -> None:
        """See that a sequence that was killed found the surface of one that was not."""
        now = contents(self.folder / self.command.out)
        if self._beside is not None and now.get(SURFACE) != self.whole.get(SURFACE):
            self.faults.append("its surface is not the uninterrupted one's")

    @property
    def _beside(self) -> Path | None:
        beside = self.command.beside
        return None if beside is None else self.folder / beside

    @property
    def _is_dataset(self) -> bool:
        return self.command.out == DATASET

    def _look(
        self, how: str, code: int, said: str, before: dict[str, bytes], struck: bool,
        number: signal.Signals,
    ) -> None:  # fmt: skip
        if "Traceback" in said or len(_beside_progress(said)) > 1:
            self.faults.append(f"{how}: said {said[-300:]!r}")
        if struck and number is not signal.SIGKILL:
            if code not in (0, 1, INTERRUPTED):
                self.faults.append(f"{how}: exit code {code}: {said[-200:]!r}")
            if leftovers(self.folder) and code == INTERRUPTED:
                self.faults.append(f"{how}: left {leftovers(self.folder)}")
        fault = self._state(before)
        if fault:
            self.faults.append(f"{how}: {fault}")

    def _state(self, before: dict[str, bytes]) -> str | None:
        """Return what is wrong with the output: it is absent, as before, or complete."""
        out = self.folder / self.command.out
        now = contents(out)
        if self._is_dataset:  # each sample is absent or complete
            samples = out / "samples"
            folders = [p for p in samples.glob("[0-9]*") if p.is_dir()] if samples.exists() else []
            return next((fault for p in folders if (fault := _fault(p))), None)
        if self._beside is not None and self._beside.exists() and (fault := _fault(self._beside)):
            return fault
        if not out.exists() or now == before:
            return None
        return _fault(out) if out.is_dir() else _cut(now, self.whole)

    def _forget(self) -> None:
        out = self.folder / self.command.out
        shutil.rmtree(out, ignore_errors=True)
        out.unlink(missing_ok=True)
        if self._beside is not None:
            shutil.rmtree(self._beside, ignore_errors=True)


def _fault(folder: Path) -> str | None:
    mark = read_mark(folder)
    if mark is None or files_in(folder) != mark.files:
        return f"{folder.name} is not what its mark lists"
    return None


def _beside_progress(said: str) -> list[str]:
    """Return the lines of a command's stderr but those that tell of progress, after two seconds."""
    return [line for line in said.splitlines() if not line.startswith("[ ")]


def _cut(now: dict[str, bytes], whole: dict[str, bytes]) -> str | None:
    sizes = [len(next(iter(c.values()))) for c in (now, whole)]
    return None if sizes[0] == sizes[1] else f"{sizes[0]} bytes instead of {sizes[1]}"


def contents(path: Path) -> dict[str, bytes]:
    """Return the files of a folder, or the one file, by their paths in it."""
    if path.is_file():
        return {"": path.read_bytes()}
    return {
        str(p.relative_to(path)): p.read_bytes()
        for p in sorted(path.rglob("*"))
        if p.is_file() and p.name not in (".lock", "manifest.json.lock")
    }


def leftovers(folder: Path) -> list[str]:
    """Return what is half written in a folder and below."""
    found = {p for form in LITTER for p in folder.rglob(form)}
    return sorted(str(p.relative_to(folder)) for p in found)


def _children(pid: int) -> list[int]:
    """Return the worker processes of a process, by Linux's list of them."""
    listed = Path(f"/proc/{pid}/task/{pid}/children")
    children = [int(c) for c in listed.read_text().split()] if listed.exists() else []
    return [c for c in children if b"spawn_main" in Path(f"/proc/{c}/cmdline").read_bytes()]


def main(
    kills: Annotated[int, Option(min=1, help="Kills of a live process, over all.")] = 100,
    seed: Annotated[int, Option(min=0)] = 0,
    only: Annotated[str | None, Option(help="Commands whose names begin so.")] = None,
    out: Annotated[Path, Option(help="Folder to work in; it must be new.")] = Path("kills-output"),
) -> None:
    """Parse, kill, tell."""
    os.environ[VARIABLE] = str((out / "sound").absolute())
    chosen = chosen_by(only, COMMANDS)
    rng, hits, faults = np.random.default_rng(seed), Counter[str](), list[str]()
    for k, command in enumerate(chosen):
        wanted = kills // len(chosen) + (k < kills % len(chosen))
        patient = Patient(command, out.absolute() / command.name.replace(" ", "_"))
        while hits[command.name] < wanted:
            hits[command.name] += patient.kill(rng)
        patient.end()
        faults += [f"{command.name}: {fault}" for fault in patient.faults]
        typer.echo(f"{command.name}: {hits[command.name]} kills, {len(patient.faults)} faults")
        for fault in patient.faults:
            typer.echo(f"  {fault}")
    typer.echo(f"{sum(hits.values())} kills of a live process, {len(faults)} faults.")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    typer.run(main)
