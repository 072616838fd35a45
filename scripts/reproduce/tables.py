"""Tables: CSV for programs, Markdown for people."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_endo.files import atomic_path

Row = Mapping[str, str | float | int | None]


def save_table(rows: Sequence[Row], out: Path, name: str) -> None:
    """Write ``name.csv`` and ``name.md`` into the folder ``out`` and print the latter."""
    with atomic_path(out / f"{name}.csv") as aside, aside.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    text = markdown(rows)
    with atomic_path(out / f"{name}.md") as aside:
        aside.write_text(text, encoding="utf-8")
    print(f"{name}\n{text}", flush=True)


def markdown(rows: Sequence[Row]) -> str:
    """Return rows as a Markdown table; numbers have three significant digits."""
    lines = [list(rows[0]), ["---"] * len(rows[0])]
    lines += [[_cell(value) for value in row.values()] for row in rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def spread(values: Sequence[float] | NDArray[np.float64], digits: int = 3) -> str:
    """Return the median and the range of values that are known, ``0.12 (0.08-0.21)``."""
    known = np.array([v for v in values if np.isfinite(v)])
    if not len(known):
        return "none"
    middle, low, high = (f"{v:.{digits}g}" for v in (np.median(known), known.min(), known.max()))
    lost = len(values) - len(known)
    return f"{middle} ({low} to {high})" + (f", {lost} failed" if lost else "")


def _cell(value: str | float | int | None) -> str:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def save_targets(out: Path, targets: Sequence[tuple[str, float, str, float]]) -> None:
    """Write ``targets.csv`` from figure, value, ``at most`` or ``at least``, and target."""
    rows = [
        {
            "figure": figure,
            "value": value,
            "target": f"{direction} {target:g}",
            "reached": "yes" if _reached(value, direction, target) else "**no**",
        }
        for figure, value, direction, target in targets
    ]
    save_table(rows, out, "targets")


def _reached(value: float, direction: str, target: float) -> bool:
    return value <= target if direction == "at most" else value >= target
