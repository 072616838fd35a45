"""``mitsuba-endo evaluate``: errors of a solution against the truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import Debug, Json, Quiet, Session, session
from .options import Result

if TYPE_CHECKING:
    from ..evaluate.metrics_file import Metrics
    from ..evaluate.sequence_metrics import SequenceMetrics

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
    """Compare a solution, or a tracked sequence frame by frame, with the truth."""
    with session(quiet, as_json, debug) as output:
        from ..outputs import prepare_file
        from ..show.read_sequence import is_sequence_folder

        prepare_file(out, [*result_files(result), *result_files(truth)], [METRICS])
        compare = evaluate_tracked if is_sequence_folder(result) else evaluate_folders
        metrics = compare(result, truth)
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


def evaluate_tracked(result: Path, truth: Path) -> "SequenceMetrics":
    """Compare a sequence's folder with a truth of all of its frames.

    Raises:
        InputError: a file is missing or wrong, or a frame is not in the truth.
    """
    from ..evaluate.sequence_errors import evaluate_sequence
    from ..records.solution import load_solution
    from ..records.surface import load_surface
    from ..show.read_sequence import read_sequence_folder

    exact = load_solution(truth)
    surface = exact.surface and load_surface(_folder(truth) / exact.surface)
    return evaluate_sequence(read_sequence_folder(result), exact, surface or None)


def _folder(path: Path) -> Path:
    return path if path.is_dir() else path.parent


def result_files(path: Path) -> list[Path]:
    """Return the folder of a solution or truth, and the file in it."""
    folder = _folder(path)
    return [folder, *(folder / name for name in ("solution.json", "truth.json")), path]


def report(metrics: "Metrics | SequenceMetrics", output: Session) -> None:
    """Print the errors with their units, and why some are missing."""
    from ..evaluate.metrics_file import Metrics
    from .summary import metrics_table, sequence_table

    single = isinstance(metrics, Metrics)
    output.print(metrics_table(metrics) if single else sequence_table(metrics))
