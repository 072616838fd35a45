"""``mitsuba-endo patterns``: what to project for ``decode-stack`` and ``decode``."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import Debug, Json, Quiet, session
from .stack_options import (
    Height,
    Inverse,
    Periods,
    Reference,
    Steps,
    Stripe,
    Width,
    make_plan,
)

if TYPE_CHECKING:
    from ..decoding.stack_plan import StackPlan

Projected = Annotated[
    str, typer.Option("--pattern", "--kind", help="gray, phase, gray+phase or coded.")
]
_CODED = ("coded", "pattern:coded")
Out = Annotated[Path, typer.Option("--out", help="Folder to write.")]


def patterns(
    kind: Projected,
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
    """Write patterns to project: a Gray-code or phase-shift stack, or the coded grid.

    A stack is images numbered in order. The coded grid, --pattern coded (or
    pattern:coded?period=16&seed=3), is one pattern as coded.png, coded.tiff, coded.svg for a mask
    maker, and coded.json with its code.
    """
    with session(quiet, as_json, debug) as output:
        from ..decoding.stack_files import save_patterns
        from ..folder_mark import Kind
        from ..outputs import prepare_folder

        prepare_folder(out, Kind.PATTERNS)
        if kind.partition("?")[0] in _CODED:
            _no_stack(inverse, reference, stripe, periods, steps)
            names, command = _coded(out, kind, width, height)
        else:
            plan = make_plan(kind, width, height, inverse, reference, stripe, periods, steps)
            names, command = save_patterns(out, plan), _command(plan)
        output.print(f"{out}: {len(names)} files; decode pictures of them with", command)
        output.summary({"folder": str(out), "images": names, "decode": command})


def _coded(out: Path, kind: str, width: int, height: int) -> tuple[list[str], str]:
    """Write the coded grid; return the files and the command that decodes pictures of it."""
    from ..decoding.grid_files import description, save_grid
    from ..decoding.pattern_option import coded_grid

    full = kind if kind.startswith("pattern:") else f"pattern:{kind}"
    grid = coded_grid(full, width, height)
    named = description(grid)["pattern"]
    command = f"mitsuba-endo decode IMAGE --rig rig.yaml --pattern '{named}' --out maps"
    return save_grid(out, grid), command


def _no_stack(
    inverse: bool,
    reference: bool,
    stripe: float | None,
    periods: str | None,
    steps: int | None,
) -> None:
    """Refuse options that only stacks of images have."""
    from ..errors import InputError

    given = {
        "--inverse": inverse, "--no-reference": not reference, "--stripe": stripe is not None,
        "--periods": periods is not None, "--steps": steps is not None,
    }  # fmt: skip
    for option, is_given in given.items():
        if is_given:
            raise InputError(
                "is for stacks, and the coded grid is one image", option, "leave it out"
            )


def _command(plan: "StackPlan") -> str:
    from ..decoding.conventions import own_convention

    parts = [
        f"mitsuba-endo decode-stack FOLDER --pattern {plan.kind}",
        f"--width {plan.width} --height {plan.height}",
        f"--reference {'first' if plan.reference else 'none'}",
        "--inverse" if plan.inverse else "",
        f"--stripe {plan.stripe:g}" if plan.stripe else "",
        f"--periods {','.join(f'{p:g}' for p in plan.periods)}" if plan.periods else "",
        f"--steps {plan.steps}" if plan.steps else "",
        f"--convention {','.join(own_convention(plan).words(plan))}",
        "--out map.exr",
    ]
    return " ".join(part for part in parts if part)
