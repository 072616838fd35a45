"""Figures of a benchmark: printed as a table, saved as JSON and CSV."""

import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import Literal, TypeVar

import numpy as np
from rich.console import Console
from rich.table import Table

from mitsuba_endo.files import atomic_path

Result = TypeVar("Result")
HEADINGS = ("figure", "value", "unit", "better", "target", "reached")
PACKAGES = ("mitsuba-endo", "mitsuba", "drjit", "numpy", "scipy", "pycolmap")


@dataclass(frozen=True)
class Figure:
    """One measured number."""

    benchmark: str
    name: str
    value: float
    unit: str
    better: Literal["lower", "higher", ""]
    """Direction; empty for a number that only explains another."""
    target: float | None = None
    """Value to reach, on the better side."""

    @property
    def reached(self) -> bool | None:
        if self.target is None:
            return None
        low = self.better == "lower"
        return bool(self.value <= self.target if low else self.value >= self.target)


def timed(run: Callable[[], Result]) -> tuple[float, Result]:
    """Return the seconds that ``run`` takes, and its result."""
    began = perf_counter()
    result = run()
    return perf_counter() - began, result


def alternating(first: Callable[[], object], second: Callable[[], object], pairs: int) -> float:
    """Return the median of time(first) / time(second), measured in turn so that load cancels.

    The order within a pair changes from pair to pair.
    """
    ratios = []
    for i in range(pairs):
        if i % 2:
            b, a = timed(second)[0], timed(first)[0]
        else:
            a, b = timed(first)[0], timed(second)[0]
        ratios.append(a / b)
    return float(np.median(ratios))


def environment() -> dict[str, object]:
    """Return what the timings depend on."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "absent"
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None,
        "load_1min": os.getloadavg()[0],
        "versions": versions,
    }


def show(figures: Sequence[Figure], console: Console) -> None:
    """Print the figures with unit, direction, target and whether it is reached."""
    table = Table(*HEADINGS)
    table.columns[1].justify = table.columns[4].justify = "right"
    for before, f in zip([None, *figures], figures, strict=False):
        if before is None or before.benchmark != f.benchmark:
            table.add_section()
            table.add_row(f"[bold]{f.benchmark}[/]")
        *cells, reached = _cells(f)
        table.add_row(*cells, f"[bold red]{reached}[/]" if reached == "no" else reached)
    console.print(table)


def _cells(f: Figure) -> list[str]:
    target = "" if f.target is None else f"{f.target:g}"
    return [
        f.name, f"{f.value:.4g}", f.unit, f.better, target,
        {None: "", True: "yes", False: "no"}[f.reached],
    ]  # fmt: skip


def markdown(figures: Sequence[Figure]) -> str:
    """Return the figures as a Markdown table."""
    rows = [["benchmark", *HEADINGS], ["---"] * (len(HEADINGS) + 1)]
    rows += [[f.benchmark, *_cells(f)] for f in figures]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def saved(out: Path) -> list[Figure]:
    """Return the figures that :func:`save` wrote into a folder; none if it did not."""
    path = out / "benchmark.json"
    if not path.is_file():
        return []
    rows = json.loads(path.read_text("utf-8"))["figures"]
    return [Figure(**{field.name: row[field.name] for field in fields(Figure)}) for row in rows]


def renewed(old: Sequence[Figure], new: Sequence[Figure]) -> list[Figure]:
    """Return old figures, those that were measured anew in their places, and the others after."""
    found = {(f.benchmark, f.name): f for f in (*old, *new)}
    return list(found.values())


def in_own_process(name: str, *, quick: bool) -> list[Figure]:
    """Run a benchmark in a process of its own and return its figures."""
    script = Path(__file__).parents[1] / "benchmark.py"
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, str(script), "--only", name, "--out", out]
        subprocess.run(command + ["--quick"] * quick, check=True)
        return saved(Path(out))


def save(figures: Sequence[Figure], out: Path) -> None:
    """Write ``benchmark.json``, ``.csv`` and ``.md`` into the folder ``out``."""
    rows = [{**asdict(f), "reached": f.reached} for f in figures]
    with atomic_path(out / "benchmark.json") as aside:
        text = json.dumps({"environment": environment(), "figures": rows}, indent=2)
        aside.write_text(text + "\n", encoding="utf-8")
    with atomic_path(out / "benchmark.csv") as aside, aside.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    with atomic_path(out / "benchmark.md") as aside:
        aside.write_text(markdown(figures), encoding="utf-8")
