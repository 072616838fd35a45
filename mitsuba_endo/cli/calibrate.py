"""``mitsuba-endo calibrate``: from correspondence maps to a solution folder."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from .console import EXIT_FAULT, EXIT_INTERRUPTED, Debug, Json, Quiet, Session, session
from .decode import Refine
from .live import watching
from .map_options import MapConvention, Mask
from .options import names_in
from .second_round import Photographs, SecondRound, keep_earlier_maps

if TYPE_CHECKING:
    from ..records.checkpoint import Checkpoint
    from ..records.correspondence import CorrespondenceMap
    from ..records.history import Observe
    from ..records.rig import Rig
    from ..records.solution import Solution
    from ..solve.options import Options

Maps = Annotated[
    list[Path],
    typer.Argument(
        metavar="MAP_OR_IMAGE",
        help="Correspondence maps, .exr, .npz or .npy, one per frame, or folders of them; or "
        "images of the coded grid.",
    ),
]
RigFile = Annotated[Path, typer.Option("--rig", help="Rig file: what is known and what is not.")]
Out = Annotated[Path, typer.Option("--out", help="Solution folder to write.")]
_SOLVERS = ("levenberg-marquardt", "gauss-newton", "adam")
"""Known without loading the solver: the default, its old name, and the published one."""


def _known_solver(name: str) -> str:
    """Refuse the name of a solver that nobody registered."""
    if name not in _SOLVERS:
        from ..solve.minimisers.minimise import ALIASES, MINIMISERS

        if name not in MINIMISERS:
            choices = ", ".join([*MINIMISERS, *ALIASES])
            raise typer.BadParameter(f"'{name}' is unknown; choose from {choices}")
    return name


Solver = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_known_solver,
        help="levenberg-marquardt (also gauss-newton), or adam, the published first-order method.",
    ),
]
SurfaceKind = Annotated[
    Literal["lattice", "mesh"],
    typer.Option(
        "--surface",
        help="Common surface of several frames: ranges seen from the first camera, or a mesh fused "
        "from all, for folds and for cameras that travel.",
    ),
]
CheckModel = Annotated[
    bool,
    typer.Option(
        "--check-model/--no-check-model",
        help="Test the model against its residuals, name what may be wrong, and widen intervals.",
    ),
]
Start = Annotated[
    Literal["search", "plane"],
    typer.Option(help="Search for a start, or the published plane and front-parallel projector."),
]
Share = Annotated[
    str | None,
    typer.Option(
        metavar="BLOCK=MODE,...",
        help="Replace entries of the rig's sharing plan, e.g. surface=per_frame,focal=fixed.",
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the random samples in the search.")]
Resume = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="Go on from an earlier or interrupted calibration."),
]


Pattern = Annotated[
    str | None,
    typer.Option(help="The pattern in the images; pattern:coded if not given.", show_default=False),
]
PatternOrStack = Annotated[
    str | None,
    typer.Option(
        help="The pattern in the images; pattern:coded if not given. For folders of a stack each: "
        "stack, gray, phase or gray+phase.",
        show_default=False,
    ),
]


Live = Annotated[
    bool, typer.Option("--live", help="Watch the optimisation in a browser; Ctrl-C ends.")
]

Save = Annotated[
    str,
    typer.Option(
        metavar="NAME,...",
        help="Further files: depth, points, masks of every frame, pictures at full size.",
        show_default=False,
    ),
]


def calibrate(
    maps: Maps,
    rig: RigFile,
    out: Out,
    solver: Solver = "levenberg-marquardt",
    surface: SurfaceKind = "lattice",
    start: Start = "search",
    check_model: CheckModel = True,
    share: Share = None,
    map_convention: MapConvention = "",
    mask: Mask = None,
    seed: Seed = 0,
    resume: Resume = None,
    pattern: PatternOrStack = None,
    refine: Refine = True,
    second_round: SecondRound = True,
    live: Live = False,
    save: Save = "",
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Find projector pose, focal length and surface from correspondence maps.

    Images of the coded grid are decoded and refined first, as by the command decode; their maps and
    pictures of the grids found go into the folder "decoded" of the solution. A second round reads
    them again along the epipolar lines of the first calibration. With --pattern stack
    each folder is a stack of Gray code or shifted fringes, decoded as by decode-stack.
    """
    from ..litter import scratch_folder

    with session(quiet, as_json, debug) as output, scratch_folder() as aside:
        from ..decoding.frame_files import frame_files
        from ..decoding.stack_map import KINDS as STACKS
        from ..folder_mark import Kind
        from ..outputs import prepare_folder
        from ..records.checkpoint import load_checkpoint
        from ..solve.options import Options
        from .decode import decode_images

        extras = _extras(save)
        given = [path for path in (rig, resume, mask) if path]
        prepare_folder(out, Kind.CALIBRATION, [*maps, *given])
        checkpoint = None if resume is None else load_checkpoint(resume)
        files = frame_files(maps)
        paths = decode_images(files, rig, pattern, refine, aside, output, map_convention)
        decoded = aside if any(aside.iterdir()) else None
        if resume is not None and decoded:
            keep_earlier_maps(aside, resume)
        again = None
        if refine and second_round and resume is None and decoded and pattern not in STACKS:
            again = Photographs(files, pattern, aside, mask, output)
        frames, rig_record = load_input(paths, rig, share, output.print, map_convention, mask)
        options = Options(
            solver=solver, surface=surface, start=start, check_model=check_model, seed=seed
        )
        with watching(live, rig_record, output) as watch:
            show = watch and watch.view.show
            solution = solve_and_write(
                frames, rig_record, options, out, output, checkpoint, show, decoded, extras, again
            )
            report(solution, out, output)
            if watch:
                watch.end(solution, output)
        raise typer.Exit(exit_code(solution))


def _extras(text: str) -> list[str]:
    """Return the names in a list of further files, refused before any work if unknown."""
    names = names_in(text)
    if names:
        from ..show.extras import check_extras

        check_extras(names, "--save")
    return names


def load_input(
    paths: list[Path],
    rig_file: Path,
    share: str | None = None,
    log: Callable[[str], None] = lambda note: None,
    convention: str = "",
    mask: Path | None = None,
) -> tuple[list["CorrespondenceMap"], "Rig"]:
    """Read and check everything that a calibration starts from.

    Args:
        paths: of the maps.
        rig_file: what is known.
        share: entries of the sharing plan to replace.
        log: called with a sentence for each camera file of another program: what was read.
        convention: words on how the maps count, see :mod:`..records.map_convention`.
        mask: of the pixels to use, an image or a folder.

    Raises:
        InputError: a file is missing or wrong, or the maps do not belong to the rig.
    """
    from ..records.rig import read_rig
    from ..sanity.examine import examine

    rig, notes = read_rig(rig_file)
    for note in notes:
        log(note)
    if share:
        rig = with_sharing(rig, share)
    maps = _load_maps(paths, rig, convention, mask)
    examine(maps, rig)  # refuses before any work; the solver asks again and keeps the warnings
    return maps, rig


def _load_maps(
    paths: list[Path], rig: "Rig", convention: str, mask: Path | None
) -> list["CorrespondenceMap"]:
    """Read maps as their makers meant them, without the pixels that a mask leaves out."""
    from ..decoding.masks import Masks
    from ..records.correspondence import load_maps
    from ..records.map_convention import read_map_convention

    size = rig.projector.width, rig.projector.height
    maps = load_maps(paths, read_map_convention(convention), size)
    masks = Masks.at(mask) if mask else None
    return [masks.applied(map_) for map_ in maps] if masks else maps


def with_sharing(rig: "Rig", text: str) -> "Rig":
    """Return the rig with entries of its sharing plan replaced, e.g. ``focal=fixed,centre=shared``.

    Raises:
        InputError: not of the form block=mode, an unknown block or mode, or two for one block.
    """
    from ..errors import InputError
    from ..records.sharing_plan import with_plan

    plan: dict[str, str] = {}
    for item in text.split(","):
        block, equals, mode = (part.strip() for part in item.partition("="))
        if not equals:
            raise InputError(f"'{item}' is not block=mode", "--share", "e.g. surface=per_frame")
        if plan.setdefault(block, mode) != mode:
            raise InputError(
                f"{block} is to be {plan[block]} and {mode}", "--share", "keep one of them"
            )
    return with_plan(rig, plan, "--share")


def solve_and_write(
    maps: list["CorrespondenceMap"],
    rig: "Rig",
    options: "Options",
    out: Path,
    output: Session,
    resume: "Checkpoint | None" = None,
    observe: "Observe | None" = None,
    decoded: Path | None = None,
    extras: Sequence[str] = (),
    photographs: Photographs | None = None,
) -> "Solution":
    """Calibrate with a progress bar, write the solution folder and return what it says.

    With photographs there is a second round.
    """
    with output.progress("Starting Mitsuba") as advance:
        from .. import backend

        backend.use()
        from ..show.solution_folder import write_solution_folder
        from ..solve.calibrate import calibrate as solve

        part = 0.5 if photographs else 1.0
        result = solve(maps, rig, options, _part(advance, 0.0, part), resume, observe)
        if photographs:
            rest = _part(advance, part, 0.95 - part)
            result = photographs.calibrated_again(result, maps, rig, options, rest, observe)
        advance(0.95, "Drawing pictures")
        return write_solution_folder(out, result, rig, decoded, extras)


def _part(
    advance: Callable[[float, str], None], begin: float, length: float
) -> Callable[[float, str], None]:
    return lambda share, step: advance(begin + length * share, step)


def exit_code(solution: "Solution") -> int:
    """0 if the calibration converged, 130 if the user stopped it, else 1."""
    from ..records.solution import Outcome

    special = {Outcome.CONVERGED: 0, Outcome.INTERRUPTED: EXIT_INTERRUPTED}
    return special.get(solution.outcome, EXIT_FAULT)


def report(solution: "Solution", out: Path, output: Session) -> None:
    """Print what was found."""
    from .summary import solution_table

    warnings = [f"warning: {warning}" for warning in solution.warnings]
    output.print(solution_table(solution), *solution.verdict, *warnings)
    output.print(f"Outcome: {solution.outcome}. Look at {out}/report.html first.")
    output.summary(
        {"folder": str(out), "solution": solution.model_dump(mode="json", by_alias=True)}
    )
