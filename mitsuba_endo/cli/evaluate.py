"""``mitsuba-endo evaluate``: errors of a solution against the truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import Debug, Json, Quiet, Session, session
from .options import Result

if TYPE_CHECKING:
    from ..evaluate.metrics import Metrics

Truth = Annotated[Path, typer.Option("--truth", help="Truth file of the synthetic scene.")]
METRICS = "metrics.json"
Out = Annotated[Path, typer.Option("--out", help="File to write, e.g. metrics.json.")]


def evaluate(
    result: Result,
    truth: Truth,
    out: Out,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Compare a solution with the truth."""
    with session(quiet, as_json, debug) as output:
        from ..outputs import prepare_file

        prepare_file(out, [*result_files(result), *result_files(truth)], [METRICS])
        metrics = evaluate_folders(result, truth)
        metrics.save(out)
        report(metrics, output)
        output.summary(metrics.model_dump(mode="json"))


def evaluate_folders(result: Path, truth: Path) -> "Metrics":
    """Compare two solution or truth files, with the surfaces that lie beside them.

    Raises:
        InputError: a file is missing or wrong, or its frames are not those of the other.
    """
    from ..evaluate.errors import evaluate as compare
    from ..records.solution import load_solution

    return compare(load_solution(result), load_solution(truth), _folder(result), _folder(truth))


def _folder(path: Path) -> Path:
    return path if path.is_dir() else path.parent


def result_files(path: Path) -> list[Path]:
    """Return the folder of a solution or truth, and the file in it."""
    folder = _folder(path)
    return [folder, *(folder / name for name in ("solution.json", "truth.json")), path]


def report(metrics: "Metrics", output: Session) -> None:
    """Print the errors with their units, and why some are missing."""
    from .summary import metrics_table

    output.print(metrics_table(metrics))
