"""The page of results, made from the tables and pictures that the experiments wrote."""

import csv
import shutil
from pathlib import Path

from mitsuba_endo.files import atomic_path

from .tables import Row, markdown

INTRO = """# Results

The experiments of the source paper and comparisons with peers, made by `make reproduce`: every
table and picture below comes from one unattended run. One script each, `scripts/reproduce_*.py`
(`--quick` shows that it runs, `--out` says where). All data are synthetic and fixed by their seeds;
solvers run in processes that are refused every file of the truth. Values with a range are the
median (lowest to highest) over seeds that were not used to choose any setting.

"""


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
    head = "## Targets\n\n" + markdown(targets) + "\n" if targets else ""
    with atomic_path(page) as aside:
        aside.write_text(INTRO + head + "\n".join(parts), encoding="utf-8")


def _targets(name: str, out: Path) -> list[Row]:
    path = out / "targets.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return [
            {"experiment": name, **row, "value": float(row["value"])}
            for row in csv.DictReader(file)
        ]
