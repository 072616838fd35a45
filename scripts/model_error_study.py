"""Right and wrong models in pieces: draws are added to a file, and those that it has are not run.

Run from the repository, as often as wanted:

    python -m scripts.model_error_study --out study.jsonl --right 200 --wrong 20
    python -m scripts.model_error_study --out study.jsonl --wrong 20 --kind "camera k1 + 0.01"
"""

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from threadpoolctl import threadpool_limits

from mitsuba_endo import backend

sys.path.insert(0, str(Path(__file__).parent))
from benchmarks.model_error import RIGHT, SEED, Drawn, figures, one
from benchmarks.model_error_scenes import KINDS
from benchmarks.report import show


def _wanted(arguments: argparse.Namespace) -> Iterator[tuple[str, int]]:
    for k in range(arguments.right):
        yield RIGHT, arguments.seed + k
    for k in range(arguments.wrong):
        for kind in arguments.kind or KINDS:
            yield kind, arguments.seed + k


def _read(path: Path) -> list[Drawn]:
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    return [Drawn(**json.loads(line)) for line in lines]


def main() -> None:
    """Parse, run what is missing, print the table of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--out", type=Path, required=True, help="file of the draws, one a line")
    parser.add_argument("--right", type=int, default=0, help="draws of the right model")
    parser.add_argument("--wrong", type=int, default=0, help="draws of every wrong model")
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="these kinds alone")
    parser.add_argument("--seed", type=int, default=SEED, help="of the first draw")
    arguments = parser.parse_args()
    backend.use()
    console = Console()
    done = {(d.kind, d.seed) for d in _read(arguments.out)}
    missing = [key for key in _wanted(arguments) if key not in done]
    with threadpool_limits(1, "blas"), arguments.out.open("a", encoding="utf-8") as file:
        for i, (kind, seed) in enumerate(missing):
            found = one(kind, seed)
            file.write(json.dumps(found.record) + "\n")
            file.flush()
            worst = max(found.deviations, default=0.0)
            console.print(f"{i + 1}/{len(missing)} {kind} {seed}: noticed {found.noticed}, first "
                          f"{found.first}, worst {worst:.1f} deviations")  # fmt: skip
    show(figures(_read(arguments.out)), console)


if __name__ == "__main__":
    main()
