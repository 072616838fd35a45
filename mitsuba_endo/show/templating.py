"""Pages from templates: what comes from files is escaped by the engine."""

from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("mitsuba_endo.show", "templates"), autoescape=True,
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    environment.filters["minus"] = minus
    return environment


def render(template: str, **content: Any) -> Markup:
    """Return a template filled in; strings are escaped, but for :class:`Markup`."""
    return Markup(_environment().get_template(template).render(**content))


def asset(name: str) -> Markup:
    """Return a script or style of the package, which goes into a page as it is."""
    return Markup(resources.files("mitsuba_endo.show").joinpath(name).read_text(encoding="utf-8"))


def minus(number: str) -> str:
    """Return a number's text with a proper minus sign."""
    return number.replace("-", "−") if number[:1] == "-" else number
