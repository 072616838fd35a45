"""``mitsuba-endo decode-stack``: from images of Gray code or shifted fringes to a map."""

from pathlib import Path
from typing import Annotated

import typer

from .console import Debug, Json, Quiet, session
from .stack_options import (
    Height,
    Inverse,
    Kind,
    Periods,
    Reference,
    Steps,
    Stripe,
    Width,
    make_plan,
)

Images = Annotated[
    list[Path],
    typer.Argument(metavar="FOLDER_OR_IMAGES...", help="One folder, or the images in order."),
]
Out = Annotated[Path, typer.Option("--out", help="Map to write, .exr or .npz.")]
MinContrast = Annotated[
    float, typer.Option(min=0, max=1, help="Contrast of a lit pixel, of full scale.")
]
Gamma = Annotated[
    float,
    typer.Option(
        min=0.1, max=5, help="Images hold brightness^(1/gamma): 2.2 for most photographs."
    ),
]


def decode_stack(
    images: Images,
    kind: Kind,
    width: Width,
    height: Height,
    out: Out,
    inverse: Inverse = False,
    reference: Reference = True,
    stripe: Stripe = None,
    periods: Periods = None,
    steps: Steps = None,
    min_contrast: MinContrast = 0.03,
    gamma: Gamma = 1.0,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Decode a Gray-code or phase-shift stack into a correspondence map.

    The images are those that the command patterns writes, in its order: white and black, then x
    and then y; Gray bits from coarse to fine, then phase periods from coarse to fine.
    """
    with session(quiet, as_json, debug) as output:
        from ..decode.stack import decode_stack as decode
        from ..decode.stack_files import check_names, load_stack, stack_paths
        from ..outputs import prepare_file
        from ..records.correspondence import check_map_path, save_map

        check_map_path(out)
        plan = make_plan(kind, width, height, inverse, reference, stripe, periods, steps)
        paths = stack_paths(images)
        prepare_file(out, paths)
        check_names(paths, plan)
        result = decode(load_stack(paths, gamma), plan, min_contrast=min_contrast)
        save_map(out, result.q)
        lit, decoded = float(result.lit.mean()), float(result.decoded.mean())
        output.print(
            f"{out}: {100 * decoded:.1f} % of the pixels decoded, "
            f"{100 * decoded / lit:.1f} % of those lit."
        )
        rows, columns = result.lit.shape
        summary = {"map": str(out), "width": columns, "height": rows, "images": len(paths)}
        output.summary(summary | {"lit": lit, "decoded": decoded, "noise": result.noise})
