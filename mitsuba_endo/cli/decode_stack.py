"""``mitsuba-endo decode-stack``: from images of Gray code or shifted fringes to a map."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import Advance, Debug, Json, Quiet, Session, session
from .map_options import Mask, mask_files
from .stack_options import Height, Periods, Steps, Stripe, Width, numbers, pair

if TYPE_CHECKING:
    from ..decoding.stack import DecodedStack
    from ..decoding.stack_reading import StackReading

Images = Annotated[
    list[Path],
    typer.Argument(
        metavar="FOLDER_OR_IMAGES...",
        help="One folder, one TIFF file of all images, or the images in order.",
    ),
]
Out = Annotated[Path, typer.Option("--out", help="Map to write, .exr or .npz.")]
Kind = Annotated[
    str | None,
    typer.Option("--pattern", "--kind", help="gray, phase or gray+phase; found if not given."),
]
Inverse = Annotated[
    bool | None,
    typer.Option("--inverse/--no-inverse", help="Each bit has its inverse; found if not given."),
]
Reference = Annotated[
    str | None,
    typer.Option(help="Where white and black are: first, last or none; found if not given."),
]
NoReference = Annotated[bool, typer.Option("--no-reference", hidden=True)]
Convention = Annotated[
    str,
    typer.Option(help="Words for order, code and phases, comma-separated; found if not given."),
]
MinContrast = Annotated[
    float, typer.Option(min=0, max=1, help="Contrast of a lit pixel, of full scale.")
]
Gamma = Annotated[
    float,
    typer.Option(
        min=0.1, max=5, help="Images hold brightness^(1/gamma): 2.2 for most photographs."
    ),
]
Offset = Annotated[
    str,
    typer.Option(
        metavar="X,Y", help="Where the pattern's first pixel lies in the projector, pixels."
    ),
]
FEW = 0.001
"""Share of the pixels whose fine bits were left out, under which nothing is said of it."""


def decode_stack(
    images: Images,
    width: Width,
    height: Height,
    out: Out = Path("map.exr"),
    kind: Kind = None,
    inverse: Inverse = None,
    reference: Reference = None,
    no_reference: NoReference = False,
    stripe: Stripe = None,
    periods: Periods = None,
    steps: Steps = None,
    convention: Convention = "",
    min_contrast: MinContrast = 0.03,
    gamma: Gamma = 1.0,
    offset: Offset = "0,0",
    mask: Mask = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Decode a Gray-code or phase-shift stack into a correspondence map.

    The order of the images, their code and what the phases show are found from the images where
    they are not stated, and said. Names as the command patterns gives them state all of it.
    """
    with session(quiet, as_json, debug) as output:
        import numpy as np

        from ..decoding.conventions import read_convention
        from ..decoding.masks import Masks
        from ..decoding.stack import decode_stack as decode
        from ..decoding.stack_files import StackFiles, stack_paths
        from ..decoding.stack_reading import StackRequest, find_reading, read_by_names
        from ..outputs import prepare_file
        from ..records.correspondence import CorrespondenceMap, check_map_path, save_map
        from ..records.map_arrays import WEIGHT

        check_map_path(out)
        request = StackRequest(
            width=width, height=height, kind=kind, inverse=inverse, stripe=stripe,  # type: ignore[arg-type]
            reference=_reference(reference, no_reference),  # type: ignore[arg-type]
            periods=numbers(periods), steps=steps, convention=read_convention(convention),
        )  # fmt: skip
        paths = stack_paths(images)
        prepare_file(out, [*(p if isinstance(p, Path) else p.path for p in paths),
                           *mask_files(mask)])  # fmt: skip
        masks = Masks.at(mask) if mask else None
        shift = pair(offset)
        reading = read_by_names(paths, request)
        if reading is None:
            request.plans(len(paths))  # refuses early
        with output.progress("Reading images") as advance:
            stack = StackFiles(paths, gamma, advance=partial(_advance, advance, "Reading images"))
            reading = reading or find_reading(
                stack, request, min_contrast=min_contrast,
                advance=partial(_advance, advance, "Finding their order"),
            )  # fmt: skip
            result = decode(
                stack, reading.plan, order=reading.order, min_contrast=min_contrast,
                advance=partial(_advance, advance, "Decoding"),
            )  # fmt: skip
        _say_notes(output, stack.notes)
        map_ = CorrespondenceMap(result.q + np.array(shift, np.float32), out.name, result.weight)
        save_map(out, masks.applied(map_).q if masks else map_.q, {WEIGHT: result.weight})
        _report(output, out, result, reading)


def _say_notes(output: Session, notes: list[str]) -> None:
    """Print what was done to the images: of many alike, the first."""
    if notes:
        more = f" ({len(notes)} images alike)" if len(notes) > 1 else ""
        output.print(f"warning: {notes[0]}{more}")


def _advance(advance: Advance, what: str, share: float) -> None:
    advance(share, what)


def _reference(stated: str | None, none: bool) -> str | None:
    from ..errors import InputError

    if not none:
        return stated
    if stated not in (None, "none"):
        raise InputError(f"'{stated}' contradicts --no-reference", "--reference", "give one")
    return "none"


def _report(output: Session, out: Path, result: "DecodedStack", reading: "StackReading") -> None:
    lit, decoded = float(result.lit.mean()), float(result.decoded.mean())
    left_out = float((result.left_out > 0)[result.decoded].mean())
    plan = reading.plan
    output.print(
        f"{out}: {100 * decoded:.1f} % of the pixels decoded, "
        f"{100 * decoded / lit:.1f} % of those lit."
    )
    if reading.by == "images":
        output.print(f"Read as --pattern {plan.kind} --convention {','.join(reading.words)}.")
    if left_out > FEW:
        output.print(f"At {100 * left_out:.1f} % of them fine bits could not be read.")
    rows, columns = result.lit.shape
    output.summary({
        "map": str(out), "width": columns, "height": rows, "images": len(reading.order),
        "lit": lit, "decoded": decoded, "noise": result.noise, "pattern": plan.kind,
        "stripe": plan.stripe or None, "steps": plan.steps or None,
        "convention": list(reading.words), "order": list(reading.order),
        "fine_bits_left_out": left_out,
    })  # fmt: skip
