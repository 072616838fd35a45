"""Which plans a stack of so many images may have."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, get_args

from ..errors import InputError
from .stack_plan import AXES, FINEST_PERIOD, STEPS, STRIPES, Kind, StackPlan

ONE_DIRECTION = (
    "if only columns or only rows were projected, project both: a point of the pattern has two "
    "coordinates"
)
"""What to do about a stack whose number of images is that of one direction."""


@dataclass(frozen=True)
class PossiblePlans:
    """The plans that a stack may have."""

    plans: list[StackPlan]
    one_direction: bool
    """Its number of images is also that of one direction alone."""

    def that(self, fits: Callable[[StackPlan], bool]) -> "PossiblePlans":
        """Return those that fit."""
        return PossiblePlans([plan for plan in self.plans if fits(plan)], self.one_direction)


def possible_plans(
    images: int,
    width: int,
    height: int,
    *,
    kind: Kind | None = None,
    reference: bool | None = None,
    inverse: bool | None = None,
    stripe: float | None = None,
    periods: tuple[float, ...] | None = None,
    steps: int | None = None,
) -> PossiblePlans:
    """Return the plans with this number of images, the commonest first.

    Args:
        images: of the stack.
        width: of the pattern, pixels.
        height: of the pattern, pixels.
        kind: None: any; likewise of the others, see :meth:`StackPlan.make`.
        reference: a white and a black image are among them.
        inverse: each bit has its inverse.
        stripe: narrowest stripe.
        periods: of the phases, pattern pixels.
        steps: per period.

    Raises:
        InputError: a value out of range, one that this kind of stack has no use for, or no plan
            that fits it has so many images.
    """
    kinds: tuple[Kind, ...] = get_args(Kind) if kind is None else (kind,)
    plans: list[StackPlan] = []
    refusals: list[InputError] = []
    for one in kinds:
        try:
            StackPlan.make(one, width, height, inverse=bool(inverse), stripe=stripe,
                           periods=periods, steps=steps)  # fmt: skip
        except InputError as refusal:
            refusals.append(refusal)
            continue
        for choice in _choices(one, width, height, reference, inverse, stripe, periods, steps):
            plan = StackPlan.make(one, width, height, **choice)
            if plan not in plans:
                plans.append(plan)
    if len(refusals) == len(kinds):
        raise refusals[0]
    usual = [plan for plan in plans if plan.usual or (stripe or steps)]
    alone = any(images == count for plan in usual for count in _one_direction(plan))
    fitting = [plan for plan in plans if len(plan.labels()) == images]
    if not fitting:
        counts = sorted({len(plan.labels()) for plan in usual})
        one = f"this pattern has {counts[0]}"
        several = f"such patterns have {', '.join(map(str, counts))}"
        raise InputError(
            f"{images} images, but {one if len(counts) == 1 else several}", "stack",
            ONE_DIRECTION if alone else
            "check the pattern's size and its options against what was projected",
        )  # fmt: skip
    return PossiblePlans(fitting, alone)


def _one_direction(plan: StackPlan) -> list[int]:
    """Return the numbers of images if only columns or only rows were projected."""
    return [len(plan.reference_labels()) + len(plan.axis_labels(axis)) for axis in AXES]


def _choices(
    kind: Kind,
    width: int,
    height: int,
    reference: bool | None,
    inverse: bool | None,
    stripe: float | None,
    periods: tuple[float, ...] | None,
    steps: int | None,
) -> Iterator[dict[str, Any]]:
    """Yield what may be given to :meth:`StackPlan.make`, with what is not known filled in."""
    finest = periods[0] if periods else FINEST_PERIOD
    widest = min(width, height) // 2 if kind == "gray" else finest / 2
    wide = [float(w) for w in STRIPES if w <= widest]
    if kind == "gray+phase":
        wide += [w for w in (finest / 2, finest) if w not in wide]
    fill = {
        "reference": (True, False) if reference is None else (reference,),
        "inverse": ((False, True) if inverse is None else (inverse,)) if kind != "phase" else (),
        "stripe": ([None, *wide] if stripe is None else [stripe]) if kind != "phase" else (),
        "periods": (periods,) if kind != "gray" else (),
        "steps": (([None, *STEPS]) if steps is None else [steps]) if kind != "gray" else (),
    }
    used = {name: values for name, values in fill.items() if values}
    for values in product(*used.values()):
        yield dict(zip(used, values, strict=True))
