"""Spoil many files in many ways and let every reader of the package read them.

python -m scripts.reliability_campaign --count 10000 --seed 1 --out reliability-output

Every attempt runs in a process that may die, and is ended when it does not answer. What is wanted:
no exception but ``InputError``, no death by a signal, no hang, and less than 2 GiB of memory. One
attempt alone: ``--only "map npz" --seed 17 --count 1``.
"""

import json
import os
import selectors
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from mitsuba_endo.files import atomic_path
from scripts.reliability.choice import chosen_by
from scripts.reliability.readers import READERS
from scripts.reliability.sound import VARIABLE

HANG_S = 10.0
"""Of the processor's time: the machine may have other work."""
WAIT_S = 60.0
"""Seconds without an answer after which a process is ended."""
MOST_MIB = 2048
RECYCLED = 400
"""Attempts after which a process is replaced, and so its peak of memory."""
WARM_S = 120.0
"""For the first attempt of a process, which imports what it needs and makes the sound files."""
Option = typer.Option


class Attempts:
    """A process of :mod:`.reliability.attempt`, replaced when it is dead or old."""

    def __init__(self, sound: Path) -> None:
        self._environment = {**os.environ, VARIABLE: str(sound), "OMP_NUM_THREADS": "1"}
        self._process: subprocess.Popen[str] | None = None
        self._left = 0
        self._seen: set[str] = set()

    def __call__(self, name: str, seed: int) -> dict[str, Any]:
        """Try one file; a dead or hanging process is a result too."""
        process = self._running()
        assert process.stdin is not None
        assert process.stdout is not None
        patience = WAIT_S if name in self._seen else WARM_S
        process.stdin.write(f"{name} {seed}\n")
        process.stdin.flush()
        self._left -= 1
        with selectors.DefaultSelector() as selector:
            selector.register(process.stdout, selectors.EVENT_READ)
            answered = bool(selector.select(patience))
        line = process.stdout.readline() if answered else ""
        if line:
            self._seen.add(name)
            return json.loads(line)
        self.end()
        code = process.returncode
        ended = "death" if answered else "hang"
        seconds = 0.0 if answered else patience
        return {"reader": name, "seed": seed, "ended": ended, "said": f"exit code {code}",
                "seconds": seconds, "cpu": 0.0, "peak_mib": 0}  # fmt: skip

    def end(self) -> None:
        """End the process."""
        if self._process is not None:
            assert self._process.stdin is not None
            assert self._process.stdout is not None
            if self._process.poll() is None:
                self._process.kill()
            self._process.wait()
            self._process.stdin.close()
            self._process.stdout.close()
            self._process = None
        self._seen.clear()

    def _running(self) -> "subprocess.Popen[str]":
        if self._left <= 0:
            self.end()
        if self._process is None:
            command = [sys.executable, "-m", "scripts.reliability.attempt"]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                text=True, env=self._environment,
            )  # fmt: skip
            self._left = RECYCLED
        return self._process


def plan(count: int, only: str | None) -> list[str]:
    """Return the readers to try, as often as their shares say, each in one go.

    Raises:
        typer.BadParameter: no reader is called so.
    """
    chosen = chosen_by(only, READERS)
    shares = np.array([r.share for r in chosen])
    each = np.maximum(1, np.floor(count * shares / shares.sum())).astype(int)
    each[int(np.argmax(shares))] += max(0, count - int(each.sum()))
    return [r.name for r, n in zip(chosen, each, strict=True) for _ in range(n)][:count]


def bad(result: dict[str, Any]) -> bool:
    """Tell whether an attempt ended as none must."""
    slow = result["cpu"] > HANG_S
    return result["ended"] not in ("read", "refused") or slow or result["peak_mib"] > MOST_MIB


def main(
    count: Annotated[int, Option(min=1, help="Files to spoil.")] = 1000,
    seed: Annotated[int, Option(min=0, help="Seed of the first; the others follow.")] = 0,
    only: Annotated[str | None, Option(help="Readers whose names begin so.")] = None,
    out: Annotated[Path, Option(help="Folder for results.json.")] = Path("reliability-output"),
) -> None:
    """Parse, try, tell."""
    names = plan(count, only)
    out.mkdir(parents=True, exist_ok=True)
    attempts, results = Attempts((out / "sound").absolute()), []
    started = time.monotonic()
    try:
        for number, name in enumerate(names):
            results.append(attempts(name, seed + number))
            if bad(results[-1]):
                typer.echo(json.dumps(results[-1]))
            if sys.stderr.isatty():
                print(f"\r{number + 1} of {count}", end="", file=sys.stderr)
    finally:
        attempts.end()
    with atomic_path(out / "results.json") as aside:
        aside.write_text(json.dumps(results, indent=0), encoding="utf-8")
    ended = Counter(r["ended"] for r in results)
    slowest = max(r["cpu"] for r in results)
    peak = max(r["peak_mib"] for r in results)
    typer.echo(
        f"{len(results)} files in {time.monotonic() - started:.0f} s: {dict(ended)}; slowest "
        f"{slowest:.1f} s, peak {peak} MiB; {sum(map(bad, results))} ended as none must."
    )
    raise typer.Exit(1 if any(map(bad, results)) else 0)


if __name__ == "__main__":
    typer.run(main)
