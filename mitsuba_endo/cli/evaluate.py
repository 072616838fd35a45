"""``mitsuba-endo evaluate``: errors of a result against the truth."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from .console import Debug, Json, Quiet, Session, session

if TYPE_CHECKING:
    from ..evaluate.kinds import Evaluated
    from ..evaluate.sequence_metrics import SequenceMetrics

Compared = Annotated[
    Path,
    typer.Argument(
        metavar="RESULT",
        help="Solution folder or solution.json; an OpenCV file of camera and projector, or a "
        "COLMAP model.",
    ),
]
TruthPaths = Annotated[
    list[Path],
    typer.Option(
        "--truth",
        metavar="PATH",
        help="Truth, several times if there are several; or a folder of `render`'s folders; or a "
        "calibration as RESULT.",
    ),
]
Match = Annotated[
    Literal["name", "order"],
    typer.Option(help="How frames are paired: by name, folders included, or as they come."),
]
METRICS = "metrics.json"
Out = Annotated[Path, typer.Option("--out", help="File to write, e.g. metrics.json.")]


def evaluate(
    result: Compared,
    truth: TruthPaths,
    out: Out,
    match: Match = "name",
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Compare a result with the truth: errors, intervals, and whether these hold the truth."""
    with session(quiet, as_json, debug) as output:
        from ..evaluate.kinds import evaluate_result
        from ..evaluate.truths import check_apart
        from ..outputs import prepare_file
        from ..show.read_sequence import is_sequence_folder
        from .summary import sequence_table

        read = [file for path in (result, *truth) for file in result_files(path)]
        prepare_file(out, read, [METRICS])
        check_apart(result, truth)
        if is_sequence_folder(result):
            tracked = evaluate_tracked(result, truth)
            tracked.save(out)
            output.print(sequence_table(tracked))
            output.summary(tracked.model_dump(mode="json"))
            return
        metrics = evaluate_result(result, truth, match)
        metrics.save(out)
        report(metrics, output)
        output.summary(metrics.summary())


def evaluate_tracked(result: Path, truths: Sequence[Path]) -> "SequenceMetrics":
    """Compare a sequence's folder with a truth of all of its frames.

    Raises:
        InputError: a file is missing or wrong, there are several truths, or a frame is not in the
            truth.
    """
    from ..errors import InputError
    from ..evaluate.sequence_errors import evaluate_sequence
    from ..records.solution import load_solution
    from ..records.surface import load_surface
    from ..show.read_sequence import read_sequence_folder

    if len(truths) != 1:
        raise InputError("a sequence has one truth of all frames", "--truth", "give it once")
    exact, folder = load_solution(truths[0]), truths[0]
    folder = folder if folder.is_dir() else folder.parent
    surface = exact.surface and load_surface(folder / exact.surface)
    return evaluate_sequence(read_sequence_folder(result), exact, surface or None)


def result_files(path: Path) -> list[Path]:
    """Return the folder of a solution or truth, and the file in it."""
    folder = path if path.is_dir() else path.parent
    return [folder, *(folder / name for name in ("solution.json", "truth.json")), path]


def report(metrics: "Evaluated", output: Session) -> None:
    """Print the errors with their units, and why some are missing."""
    from .summary import error_table

    output.print(*(error_table(table) for table in metrics.tables()))
