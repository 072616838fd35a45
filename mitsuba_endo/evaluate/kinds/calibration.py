"""A calibration against one truth or several: solution folders, truths, OpenCV's and COLMAP's."""

from collections.abc import Sequence
from pathlib import Path

from ...records.calibration_files import read_calibration
from ..errors import evaluate
from ..matching import MatchBy
from ..metrics_file import Metrics
from ..truths import load_truths
from .registry import register_evaluation


@register_evaluation("calibration", lambda _path: True)
def evaluate_calibration(result: Path, truths: Sequence[Path], match: MatchBy = "name") -> Metrics:
    """Compare a calibration with the truth of its frames.

    Raises:
        InputError: a file is missing or wrong, or frames cannot be paired.
    """
    solution, _ = read_calibration(result)
    folder = result if result.is_dir() else result.parent
    return evaluate(solution, load_truths(truths), folder, match=match)
