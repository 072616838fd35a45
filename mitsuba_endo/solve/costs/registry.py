"""Priors that a rig asks for: each file that has one registers how to make it."""

from collections.abc import Callable

from ...records.rig import Rig
from ..unknowns.layout import Layout
from .term import Term

MakePrior = Callable[[Rig, Layout], Term | None]

PRIORS: list[MakePrior] = []


def register_prior(make: MakePrior) -> MakePrior:
    """Decorate a function that returns the term which a rig asks for, or None."""
    PRIORS.append(make)
    return make


def priors_of(rig: Rig, layout: Layout) -> list[Term]:
    """Return the terms that a rig asks for.

    Raises:
        InputError: it asks for something that contradicts itself.
    """
    terms = [make(rig, layout) for make in PRIORS]
    return [term for term in terms if term is not None]
