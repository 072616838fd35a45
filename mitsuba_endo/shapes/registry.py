"""Shapes by name: registration, checked parameters, and one call from name to mesh."""

from collections.abc import Callable
from dataclasses import fields
from typing import Annotated, Any, Protocol, TypeVar

from pydantic import ConfigDict, Field, ValidationError

from mitsuba_endo.errors import InputError
from mitsuba_endo.shapes.mesh import Mesh

# Parameter types shared by the shapes. Lengths are in mm, angles in radians.
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
HalfAngle = Annotated[float, Field(gt=0, lt=1.5, allow_inf_nan=False)]
Tilt = Annotated[float, Field(gt=-1.5, lt=1.5, allow_inf_nan=False)]
Seed = Annotated[int, Field(ge=0)]

CHECKED = ConfigDict(extra="forbid")
"""Configuration of every shape's pydantic dataclass: an unknown parameter is an error."""


class Shape(Protocol):
    """A frozen record of parameters that can build its surface."""

    def mesh(self) -> Mesh:
        """Build the surface."""
        ...


SHAPES: dict[str, type[Shape]] = {}
"""Every registered shape, by the name used in scenes and commands."""

S = TypeVar("S", bound=Shape)


def register(name: str) -> Callable[[type[S]], type[S]]:
    """Enter the decorated shape into `SHAPES` under `name`.

    A new shape is one file with a decorated class, imported in `mitsuba_endo.shapes`.
    """

    def enter(cls: type[S]) -> type[S]:
        if name in SHAPES:
            raise ValueError(f"two shapes are called {name!r}")
        SHAPES[name] = cls
        return cls

    return enter


def parse_shape(name: str, **params: Any) -> Shape:
    """Return the shape called `name` with checked parameters; what is not given has its default.

    Raises:
        InputError: unknown shape, unknown parameter, or a value that is out of range.
    """
    if name not in SHAPES:
        raise InputError(
            f"there is no shape called {name!r}",
            where="shape",
            todo=f"choose one of {', '.join(sorted(SHAPES))}",
        )
    try:
        return SHAPES[name](**params)
    except ValidationError as error:
        raise _explain(name, error) from None


def make_shape(name: str, **params: Any) -> Mesh:
    """Build the mesh of the shape called `name`.

    The same name, parameters and seed give the same mesh to the last bit on one machine.

        mesh = make_shape("colon", seed=3, bend=0.4)
        mesh.save("colon.ply")

    Raises:
        InputError: unknown shape, unknown parameter, or a value that is out of range.
    """
    return parse_shape(name, **params).mesh()


def _explain(name: str, error: ValidationError) -> InputError:
    """Turn the first of pydantic's complaints into one sentence that names the field."""
    first = error.errors()[0]
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        return cause
    field = ".".join(str(part) for part in first["loc"])
    if first["type"] == "unexpected_keyword_argument":
        what = f"there is no parameter {field!r}"
        nested = len(first["loc"]) > 1
        todo = "remove it" if nested else f"choose among {', '.join(parameter_names(name))}"
    else:
        what = f"{first['msg'][0].lower()}{first['msg'][1:]}, not {first['input']!r}"
        todo = "correct the value"
    return InputError(what, where=f"{name}: {field}", todo=todo)


def parameter_names(name: str) -> tuple[str, ...]:
    """Return the names of the parameters that the shape called `name` takes."""
    return tuple(field.name for field in fields(SHAPES[name]))  # pyright: ignore[reportArgumentType]
