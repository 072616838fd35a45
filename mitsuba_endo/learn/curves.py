"""The course of a training: one table, one picture."""

import csv
from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from ..files import atomic_path
from .pixel_metrics import PixelMetrics
from .validation import SCENARIOS

Row = dict[str, float | str]
SHOWN = {
    "median": "median error (periods)", "p95": "95th percentile (periods)",
    "gross": "error > 1/4 period (share)", "coverage": "coverage of lit pixels",
    "code_right": "codes right", "edge_recall": "depth edges found",
}  # fmt: skip
LOGARITHMIC = ("median", "p95", "gross")


def rows(epoch: int, step: int, minutes: float, loss: float,
         scores: dict[str, PixelMetrics]) -> list[Row]:  # fmt: skip
    """Return one row per scenario."""
    start: Row = {
        "epoch": epoch,
        "step": step,
        "minutes": round(minutes, 2),
        "loss": round(loss, 5),
    }
    return [
        start | {"scenario": name} | {k: round(getattr(m, k), 6) for k in PixelMetrics.names()}
        for name, m in scores.items()
    ]


def save_table(path: Path, history: Sequence[Row]) -> None:
    """Write the rows as CSV."""
    with atomic_path(path) as aside, aside.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(history[0]))
        writer.writeheader()
        writer.writerows(history)


def save_curves(path: Path, history: Sequence[Row]) -> None:
    """Draw every metric against the step."""
    figure = Figure(figsize=(10, 6), dpi=100, layout="constrained")
    for axes, (name, title) in zip(figure.subplots(2, 3).flat, SHOWN.items(), strict=True):
        for scenario in SCENARIOS:
            chosen = [row for row in history if row["scenario"] == scenario]
            axes.plot([r["step"] for r in chosen], [r[name] for r in chosen], label=scenario)
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.3)
        if name in LOGARITHMIC:
            axes.set_yscale("log")
    figure.axes[0].legend(fontsize=8)
    for axes in figure.axes[3:]:
        axes.set_xlabel("step")
    with atomic_path(path) as aside:
        figure.savefig(aside)
