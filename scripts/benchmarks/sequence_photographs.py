"""Photographs of a withdrawal, path-traced once and kept on disk, tracked as a user would."""

from pathlib import Path

from mitsuba_endo.cli.console import Session
from mitsuba_endo.cli.render_sequence import SequenceRequest, render_sequence
from mitsuba_endo.evaluate.sequence_errors import evaluate_sequence
from mitsuba_endo.evaluate.sequence_metrics import SequenceMetrics
from mitsuba_endo.records.rig import load_rig
from mitsuba_endo.records.solution import load_solution
from mitsuba_endo.records.surface import load_surface
from mitsuba_endo.sequence.inputs import frames_of

from .sequence_run import SequenceRun, TimedFeed, run_frames

FOLDER = Path("build/sequence_photographs")
"""Ignored by git; after a change of the renderer remove the folder."""
SETTINGS = {
    "surface": "shape:colon?behind=70&radius=22&length=40&bend=0.3&fold_depth=6&edge=1.2&seed=5",
    "width": "320", "height": "240", "fx": "190", "cx": "160.4", "cy": "117.7",
}  # fmt: skip
SPP, SEED = 16, 5
TARGETS = {"lost": 5.0, "trajectory": 0.6, "surface": 0.4, "rate": 2.0}


def tracked(count: int) -> SequenceRun:
    """Render ``count`` photographs if they are not there, decode, refine and track them."""
    folder = _folder(count)
    if not folder.is_dir():
        way = SequenceRequest("withdrawal", frames=count, photographs=True)
        silent = Session(quiet=True, as_json=False)
        render_sequence("colon", folder, SETTINGS, way, SPP, SEED, silent)
    rig = load_rig(folder / "rig.yaml")
    return run_frames(frames_of([folder / "images"], rig), rig, TimedFeed(()))


def compared(found: SequenceRun) -> SequenceMetrics:
    """Compare with the truth beside the photographs."""
    folder = _folder(len(found.rows))
    surface = load_surface(folder / "truth_surface.ply")
    return evaluate_sequence(found.tracked, load_solution(folder / "truth.json"), surface)


def _folder(count: int) -> Path:
    return FOLDER / f"colon_{count}"
