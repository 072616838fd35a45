"""Run every experiment, one after the other, and write the page of results.

python scripts/reproduce_all.py --out reproduce-output --page docs/results.md [--only NAME]...
"""

import ast
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer
from reproduce.command import OUT, Out, Quick
from reproduce.results import write_results

EXPERIMENTS = (
    "simulation", "per_frame", "focal", "phantoms", "peers", "robustness", "polyp",
)  # fmt: skip
LIMIT_S = 1800
"""Of one experiment: none may hold up the others for ever."""


def main(
    out: Out = OUT,
    page: Annotated[Path, typer.Option(help="Page to write.")] = OUT / "results.md",
    quick: Quick = False,
    only: Annotated[list[str] | None, typer.Option(help="Run these alone.")] = None,
    collect: Annotated[bool, typer.Option(help="Run nothing: write the page again.")] = False,
) -> None:
    """Run them; an experiment that fails leaves its older output and ends the run with code 1."""
    here, failed = Path(__file__).parent, []
    for name in () if collect else only or EXPERIMENTS:
        began = perf_counter()
        script = here / f"reproduce_{name}.py"
        command = [sys.executable, str(script), "--out", str(out / name)]
        code = _run(command + ["--quick"] * quick)
        print(f"{name}: {perf_counter() - began:.0f} s" + (f", code {code}" if code else ""))
        failed += [name] * bool(code)
    done = {}
    for name in EXPERIMENTS:
        if any((out / name).glob("*.md")):
            source = (here / f"reproduce_{name}.py").read_text(encoding="utf-8")
            done[name] = (ast.get_docstring(ast.parse(source)) or name, out / name)
    write_results(page, done)
    if failed:
        raise typer.Exit(1)


def _run(command: list[str]) -> int:
    try:
        return subprocess.run(command, timeout=LIMIT_S, check=False).returncode
    except subprocess.TimeoutExpired:
        return 124


if __name__ == "__main__":
    typer.run(main)
