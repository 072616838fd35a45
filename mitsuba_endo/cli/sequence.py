"""``mitsuba-endo sequence``: from a video to poses of all frames and one surface."""

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .calibrate import Pattern
from .console import EXIT_FAULT, EXIT_INTERRUPTED, Debug, Json, Quiet, Session, session
from .decode import Refine
from .live import watching_sequence
from .map_options import MapConvention, Mask
from .options import names_in

if TYPE_CHECKING:
    from ..records.rig import Rig
    from ..records.trajectory import FrameRow
    from ..sequence.inputs import Feed
    from ..sequence.keeper import Keeper
    from ..sequence.options import SequenceOptions
    from ..sequence.outcome import SequenceResult
    from ..sequence.resume import Past
    from ..show.unfinished_folder import UnfinishedFolder

Frames = Annotated[
    list[Path],
    typer.Argument(
        metavar="VIDEO_OR_FOLDER_OR_MAP",
        help="A video or a folder of images of the coded grid, or correspondence maps, in order.",
    ),
]
RigFile = Annotated[Path, typer.Option("--rig", help="Rig file: what is known and what is not.")]
Out = Annotated[Path, typer.Option("--out", help="Folder to write.")]
First = Annotated[int, typer.Option("--start", min=0, help="First frame to use, from 0.")]
End = Annotated[int | None, typer.Option(min=1, help="Frame to stop before; all, if not given.")]
Stride = Annotated[int, typer.Option(min=1, help="Use every so many frames.")]
Voxel = Annotated[
    float | None,
    typer.Option(min=1e-6, help="Side of the map's voxels, mm; chosen, if not given."),
]
Resume = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Go on with a stopped sequence, or with new frames after those of a finished one.",
    ),
]
Save = Annotated[
    str,
    typer.Option(
        metavar="NAME,...",
        help="Further files of every frame: depth, points.",
        show_default=False,
    ),
]
Live = Annotated[bool, typer.Option("--live", help="Watch the map grow in a browser.")]


def sequence(
    frames: Frames,
    rig: RigFile,
    out: Out,
    start: First = 0,
    end: End = None,
    stride: Stride = 1,
    voxel: Voxel = None,
    pattern: Pattern = None,
    refine: Refine = True,
    map_convention: MapConvention = "",
    mask: Mask = None,
    resume: Resume = None,
    live: Live = False,
    save: Save = "",
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Track camera and projector through a video, and fuse what all frames see into one surface.

    The first frames are calibrated; every further one is placed against the map that grows from
    them. A frame that fits nowhere is lost, and named. Ctrl-C writes what there is; --resume goes
    on from there, also with new frames.
    """
    with session(quiet, as_json, debug) as output:
        from ..records.rig import read_rig
        from ..sequence.frame_reading import FrameReading
        from ..sequence.inputs import Chosen, frames_of
        from ..sequence.options import SequenceOptions
        from ..sequence.resume import load_state
        from ..show.unfinished_folder import UnfinishedFolder

        kinds = _kinds(save)
        _prepare(out, resume, [*frames, rig, *([mask] if mask else [])])
        record, notes = read_rig(rig)
        if notes:
            output.print(*notes)
        past = None if resume is None else load_state(resume)
        chosen = Chosen(start, end, stride)
        reading = FrameReading(pattern, refine, map_convention, str(mask) if mask else None)
        feed = frames_of(frames, record, chosen, reading, past=past)
        keeper = UnfinishedFolder(out, feed.marks, reading)
        options = SequenceOptions(voxel=voxel)
        with watching_sequence(live, record, output) as watch:
            watchers = [watch.view] if watch else []
            result = _track(feed, record, options, past, keeper, watchers, out, kinds, output)
            _report(result, out, output)
            if watch:
                watch.end(result.solution, output)
        raise typer.Exit(_exit_code(result))


def _kinds(text: str) -> list[str]:
    """Return the names in a list of further files, refused before any work if unknown."""
    names = names_in(text)
    if names:
        from ..show.extras import check_extras
        from ..show.sequence_views import KINDS

        check_extras(names, "--save", KINDS)
    return names


def _prepare(out: Path, resume: Path | None, inputs: list[Path]) -> None:
    """Refuse, before any work, folders that could not be written."""
    from ..folder_mark import Kind
    from ..outputs import prepare_folder
    from ..show.unfinished_folder import check_unfinished

    prepare_folder(out, Kind.SEQUENCE, inputs)
    check_unfinished(out, resume)


def _track(
    feed: "Feed",
    rig: "Rig",
    options: "SequenceOptions",
    past: "Past | None",
    keeper: "UnfinishedFolder",
    watching: "Sequence[Keeper]",
    out: Path,
    kinds: list[str],
    output: Session,
) -> "SequenceResult":
    """Go through the frames with a line for each, write the folder and return what was found."""
    with _progress(output, feed.count) as (announce, on_frame):
        announce("Starting Mitsuba")
        from .. import backend

        backend.use()
        from ..sequence.keeper import Keepers
        from ..sequence.outcome import outcome_of
        from ..sequence.run import run_sequence
        from ..show.sequence_folder import write_sequence_folder

        announce(
            "Calibrating the first frames" if past is None else "Passing over frames seen before"
        )
        run = past and past.go_on(rig, options, on_frame)
        keepers = Keepers([keeper, *watching])
        recorded = run_sequence(feed, rig, options, on_frame, run=run, keeper=keepers)
        announce("Adjusting all frames together")
        result = outcome_of(recorded, options.vertices)
        announce("Writing the folder")
        write_sequence_folder(out, result, keeper.copy_state, kinds)
        keeper.remove()
    return result


@contextlib.contextmanager
def _progress(
    output: Session, count: int | None
) -> Iterator[tuple[Callable[[str], None], Callable[["FrameRow"], None]]]:
    """Yield what tells of a step, and of a frame: a bar in a terminal, elsewhere a line each."""
    with output.progress("Reading") as advance:
        lines = not (output.quiet or sys.stderr.isatty())
        done = 0.0

        def say(step: str) -> None:
            advance(done, step)

        def on_frame(row: "FrameRow") -> None:
            nonlocal done
            done = 0.0 if count is None else (row.number + 1) / count
            line = frame_line(row, count)
            advance(done, line)
            if lines:
                print(line, file=sys.stderr, flush=True)

        yield say, on_frame


def frame_line(row: "FrameRow", count: int | None) -> str:
    """Return what is said of a frame while the sequence runs."""
    of = "" if count is None else f" of {count}"
    head = f"frame {row.number + 1}{of} ({row.name})"
    if row.lost:
        return f"{head}: lost, {row.lost}"
    overlap = "begins a map" if row.overlap is None else f"{100 * row.overlap:.0f} % known before"
    return f"{head}: {overlap}"


def _report(result: "SequenceResult", out: Path, output: Session) -> None:
    solution = result.solution
    output.print(*solution.verdict, *[f"warning: {w}" for w in solution.warnings])
    shown = f"; pictures of keyframes in {out}/keyframes/report.html" if result.keyframes else ""
    output.print(f"The surface is {out}/mesh.ply, the poses are {out}/frames.csv{shown}.")
    output.summary({
        "folder": str(out),
        "frames": len(result.rows),
        "lost": [{"name": row.name, "reason": row.lost} for row in result.lost],
        "parts": len(result.surfaces),
        "solution": solution.model_dump(mode="json", by_alias=True),
    })  # fmt: skip


def _exit_code(result: "SequenceResult") -> int:
    """130 if the user stopped it, 1 if it falls into parts, else 0."""
    from ..records.solution import Outcome

    if result.solution.outcome is Outcome.INTERRUPTED:
        return EXIT_INTERRUPTED
    return EXIT_FAULT if len(result.surfaces) > 1 else 0
