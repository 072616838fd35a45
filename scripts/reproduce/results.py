"""The page of results, made from the tables and pictures that the experiments wrote."""

import csv
import shutil
from pathlib import Path

import numpy as np

from mitsuba_endo.files import atomic_path

from .tables import Row, markdown

INTRO = """# Results

The experiments of the source paper and comparisons with peers, made by `make reproduce`: every
table and picture below comes from one unattended run. One script each, `scripts/reproduce_*.py`
(`--quick` shows that it runs, `--out` says where). All data are synthetic and fixed by their seeds;
solvers run in processes that are refused every file of the truth. Values with a range are the
median (lowest to highest) over seeds that were not used to choose any setting.

"""


FOUND = {
    ("polyp", "median error (%)"): (
        "The diameter of a polyp, measured on one frame, is off by {:.2g} % in the median."
    ),
    ("polyp", "95 % interval covers (%)"): (
        "Its stated 95 % interval holds the truth in {:.3g} % of the draws."
    ),
    ("per_frame", "RMSE of ours / A, median"): (
        "Frames solved together leave {:.2g} times the surface error of the same frames solved "
        "alone, with a projector pose for each, and merged by ICP and TSDF (target: 0.4)."
    ),
    ("per_frame", "RMSE of ours / B, median"): (
        "They leave {:.2g} times that of frames with one projector pose for all (target: 0.5)."
    ),
    ("focal", "direction_cosine: estimated, 4 frames / fixed, 1 frame"): (
        "A focal length estimated from four frames leaves {:.2g} times the error of one that is "
        "given wrong."
    ),
}  # fmt: skip
"""Sentences for figures, by experiment and name of the figure."""

COMPARED = {
    "peers": (
        ("law",),
        ("focal (%)", "rotation (deg)", "direction (deg)", "points (mm)", "time (s)",
         "memory (MB)"),
    ),
    "robustness": (("against", "value"), ("focal error (%)", "distance of the points (mm)")),
}  # fmt: skip
"""Of experiments with peers: the columns that name a condition, and the figures, less is better."""


def write_results(page: Path, done: dict[str, tuple[str, Path]]) -> None:
    """Write the page, and the pictures into ``images`` beside it.

    Args:
        page: Markdown file.
        done: for every experiment its script's text and the folder of its output.
    """
    images = page.parent / "images"
    images.mkdir(parents=True, exist_ok=True)
    parts, targets = [], []
    for name, (text, out) in done.items():
        title, _, about = text.strip().partition("\n")
        parts.append(f"## {title.rstrip('.')}\n{about}\n\n`python scripts/reproduce_{name}.py`\n")
        parts += [
            table.read_text(encoding="utf-8")
            for table in sorted(out.glob("*.md"))
            if table.stem not in ("targets", "polyp_draws")
        ]
        for picture in sorted(out.glob("*.png")):
            shutil.copyfile(picture, images / f"results_{picture.name}")
            parts.append(f"![{picture.stem}](images/results_{picture.name})\n")
        targets += _targets(name, out)
    foot = "## Targets\n\n" + markdown(targets) + "\n" if targets else ""
    worse = _better_peers(done)
    if worse:
        foot += f"## Where a peer does better\n\nBy more than 5 %.\n\n{markdown(worse)}\n"
    text = INTRO + found(targets) + "\n".join(parts) + ("\n" + foot if foot else "")
    with atomic_path(page) as aside:
        aside.write_text(text.rstrip("\n") + "\n", encoding="utf-8")


def found(targets: list[Row]) -> str:
    """Say in sentences what the figures with a target mean, as far as they were computed."""
    values = {
        (str(row["experiment"]), str(row["figure"])): float(row["value"])
        for row in targets
        if row["value"] is not None
    }
    said = [f"- {words.format(values[key])}\n" for key, words in FOUND.items() if key in values]
    if not said:
        return ""
    pointer = "Targets, also those missed, and where peers do better, are at [the end](#targets).\n"
    return "## What was found\n\n" + "".join(said) + f"\n{pointer}\n"


def _better_peers(done: dict[str, tuple[str, Path]]) -> list[Row]:
    """Return every figure in which a peer beats ours by more than a twentieth."""
    rows = []
    for name, (condition, figures) in COMPARED.items():
        if name not in done:
            continue
        with (done[name][1] / f"{name}.csv").open(newline="") as file:
            table = list(csv.DictReader(file))
        for at in dict.fromkeys(tuple(row[c] for c in condition) for row in table):
            group = [row for row in table if tuple(row[c] for c in condition) == at]
            rows += [
                {"experiment": name, "at": " ".join(at), "figure": figure, **found}
                for figure in figures
                if (found := _better(group, figure))
            ]
    return rows


def _better(group: list[dict[str, str]], figure: str) -> Row:
    """Return the best peer's value beside ours; nothing if ours is as good."""
    known = {row["method"]: float(row[figure] or "nan") for row in group}
    ours = known.pop("ours")
    peers = {method: value for method, value in known.items() if np.isfinite(value)}
    if not peers or min(peers.values()) > 0.95 * ours:
        return {}
    best = min(peers, key=lambda method: peers[method])
    return {"ours": ours, "best peer": best, "its": peers[best]}


def _targets(name: str, out: Path) -> list[Row]:
    path = out / "targets.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return [
            {"experiment": name, **row, "value": float(row["value"])}
            for row in csv.DictReader(file)
        ]
