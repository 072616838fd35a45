"""What a stack's images show: told by their names, stated, or found from the images."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from ..errors import InputError
from .convention_search import find_convention
from .conventions import NOTHING, OPTION, Stated, own_convention
from .image_files import ImageSource
from .possible_plans import PossiblePlans, possible_plans
from .stack import CONTRAST_OVER_NOISE, MIN_CONTRAST
from .stack_files import check_names, labelled_plan, labels_of
from .stack_images import StackSource, estimate_noise
from .stack_plan import Kind, StackPlan

Reference = Literal["first", "last", "none"]


@dataclass(frozen=True, kw_only=True)
class StackRequest:
    """What is stated of a stack; None: to be found."""

    width: int
    """Pattern pixels."""
    height: int
    kind: Kind | None = None
    inverse: bool | None = None
    """Each bit has its inverse."""
    reference: Reference | None = None
    """Where the white and the black image are."""
    stripe: float | None = None
    """Narrowest stripe, pattern pixels."""
    periods: tuple[float, ...] | None = None
    """Of the phases, pattern pixels; the default ones if not given."""
    steps: int | None = None
    """Per period."""
    convention: Stated = NOTHING

    def __post_init__(self) -> None:
        """Refuse what is no choice.

        Raises:
            InputError: names the option and the choices.
        """
        for name, value, choices in (
            ("--pattern", self.kind, get_args(Kind)),
            ("--reference", self.reference, get_args(Reference)),
        ):
            if value is not None and value not in choices:
                raise InputError(f"unknown '{value}'", name, f"choose {', '.join(choices)}")

    def plans(self, images: int) -> PossiblePlans:
        """Return the plans that a stack of so many images may have.

        Raises:
            InputError: as :func:`possible_plans`.
        """
        return possible_plans(
            images, self.width, self.height, kind=self.kind, inverse=self.inverse,
            reference=None if self.reference is None else self.reference != "none",
            stripe=self.stripe, periods=self.periods, steps=self.steps,
        )  # fmt: skip


@dataclass(frozen=True)
class StackReading:
    """What the images of a stack show."""

    plan: StackPlan
    order: tuple[int, ...]
    """Which image shows each of the plan's labels."""
    words: tuple[str, ...]
    """The convention, as ``--convention`` states it."""
    by: Literal["names", "images"]
    """What told it."""


def read_by_names(paths: Sequence[ImageSource], request: StackRequest) -> StackReading | None:
    """Return what names tell that end in labels as the command patterns gives them, else None.

    Raises:
        InputError: images are missing, too many or in another order, or the names tell otherwise
            than what is stated.
    """
    labels = labels_of(paths)
    if labels is None or request.convention.parts:
        return None
    stated: dict[str, Any] = {
        "inverse": request.inverse,
        "reference": None if request.reference is None else request.reference == "first",
        "periods": request.periods,
        "steps": request.steps,
    }
    plan = labelled_plan(
        labels, request.kind, request.width, request.height, request.stripe, stated
    )
    check_names(paths, plan)
    words = own_convention(plan).words(plan)
    return StackReading(plan, tuple(range(len(paths))), tuple(words), "names")


def find_reading(
    stack: StackSource,
    request: StackRequest,
    *,
    min_contrast: float = MIN_CONTRAST,
    advance: Callable[[float], None] = lambda share: None,
) -> StackReading:
    """Return what images show: the one reading that makes sense.

    Args:
        stack: the images, in any of the known orders.
        request: what is stated.
        min_contrast: of a lit pixel, of full scale.
        advance: called with the share that is done.

    Raises:
        InputError: no reading makes sense, or two do.
        NothingDecodedError: no pixel is lit.
    """
    possible = request.plans(len(stack))
    possible = possible.that(request.convention.fits)
    if not possible.plans:
        raise InputError(
            "states what such a stack does not have", OPTION, "leave out phases, bits or inverses"
        )
    noise = estimate_noise(stack)
    need = max(min_contrast, CONTRAST_OVER_NOISE * noise)
    best = find_convention(
        stack,
        possible,
        request.convention,
        request.reference,
        noise,
        need,
        advance,
    )
    return StackReading(best.plan, best.positions, tuple(best.words()), "images")
