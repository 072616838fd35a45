"""``mitsuba-endo patterns``: the images to project for ``decode-stack``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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

if TYPE_CHECKING:
    from ..decoding.plan import StackPlan

Out = Annotated[Path, typer.Option("--out", help="Folder to write.")]


def patterns(
    kind: Kind,
    width: Width,
    height: Height,
    out: Out,
    inverse: Inverse = False,
    reference: Reference = True,
    stripe: Stripe = None,
    periods: Periods = None,
    steps: Steps = None,
    quiet: Quiet = False,
    as_json: Json = False,
    debug: Debug = False,
) -> None:
    """Write the images of a Gray-code or phase-shift stack, numbered in order, to be projected."""
    with session(quiet, as_json, debug) as output:
        from ..decoding.stack_files import save_patterns
        from ..folder_mark import Kind
        from ..outputs import prepare_folder

        prepare_folder(out, Kind.PATTERNS)
        plan = make_plan(kind, width, height, inverse, reference, stripe, periods, steps)
        names = save_patterns(out, plan)
        output.print(f"{out}: {len(names)} images; decode pictures of them with", _command(plan))
        output.summary({"folder": str(out), "images": names, "decode": _command(plan)})


def _command(plan: "StackPlan") -> str:
    from ..decoding.conventions import own_convention

    parts = [
        f"mitsuba-endo decode-stack FOLDER --pattern {plan.kind}",
        f"--width {plan.width} --height {plan.height}",
        f"--reference {'first' if plan.reference else 'none'}",
        "--inverse" if plan.inverse else "",
        f"--stripe {plan.stripe}" if plan.stripe else "",
        f"--periods {','.join(f'{p:g}' for p in plan.periods)}" if plan.periods else "",
        f"--steps {plan.steps}" if plan.steps else "",
        f"--convention {','.join(own_convention(plan).words(plan))}",
        "--out map.exr",
    ]
    return " ".join(part for part in parts if part)
