"""Options of the commands that deal with structured-light stacks: which images a stack holds."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ..decoding.stack_plan import StackPlan

Kind = Annotated[str, typer.Option("--pattern", "--kind", help="gray, phase or gray+phase.")]
Width = Annotated[int, typer.Option(help="Pattern width, pixels.")]
Height = Annotated[int, typer.Option(help="Pattern height, pixels.")]
Inverse = Annotated[bool, typer.Option("--inverse", help="An inverse follows each Gray bit.")]
Reference = Annotated[
    bool, typer.Option("--reference/--no-reference", help="A white and a black image come first.")
]
Stripe = Annotated[float | None, typer.Option(help="Narrowest Gray stripe, pattern pixels.")]
Periods = Annotated[
    str | None, typer.Option(help="Phase periods, pattern pixels, coarsest first: 600,96,16.")
]
Steps = Annotated[int | None, typer.Option(help="Phase steps per period; 4 if not given.")]


def make_plan(
    kind: str,
    width: int,
    height: int,
    inverse: bool,
    reference: bool,
    stripe: float | None,
    periods: str | None,
    steps: int | None,
) -> "StackPlan":
    """Return the plan that the options describe.

    Raises:
        InputError: an option out of range, or one that this kind of stack has no use for.
    """
    from ..decoding.stack_plan import StackPlan

    return StackPlan.make(
        kind, width, height, reference=reference, inverse=inverse, stripe=stripe,  # type: ignore[arg-type]
        periods=numbers(periods), steps=steps,
    )  # fmt: skip


def numbers(text: str | None) -> tuple[float, ...] | None:
    """Return the numbers of a list that are separated by commas.

    Raises:
        InputError: it holds other things.
    """
    from ..errors import InputError

    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"'{text}' are not numbers", "--periods", "e.g. 600,96,16") from None


def pair(text: str) -> tuple[float, float]:
    """Return the two numbers of ``X,Y``.

    Raises:
        InputError: it holds other things.
    """
    import math

    from ..errors import InputError

    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        x, y = math.nan, math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise InputError(f"'{text}' are not two numbers", "--offset", "e.g. 128,64")
    return x, y
