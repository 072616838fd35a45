"""Schemas of YAML and JSON files, with errors that name the file and the field."""

import contextlib
import dataclasses
import difflib
from collections.abc import Iterator
from functools import lru_cache
from typing import Annotated, Any, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, ValidationError, create_model

from ..errors import InputError, shown


class Record(BaseModel):
    """Base of file records: immutable, unknown keys refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


R = TypeVar("R", bound=BaseModel)

LARGEST = 1e9
"""Of a length, mm, or a number of pixels that is believed: squares and products are finite."""
Real = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Length = Annotated[float, Field(gt=0, le=LARGEST)]
Size = Annotated[int, Field(gt=0, le=65_536)]
"""Width or height of an image or pattern, pixels."""
Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0)]
Vector2 = Annotated[list[Real], Field(min_length=2, max_length=2)]
Vector3 = Annotated[list[Real], Field(min_length=3, max_length=3)]
Matrix3 = Annotated[
    list[Annotated[list[Real], Field(min_length=3, max_length=3)]],
    Field(min_length=3, max_length=3),
]


def validate(model: type[R], data: dict[str, Any], source: str) -> R:
    """Build ``model`` from ``data``.

    Raises:
        InputError: names ``source``, the field, what is wrong and, for a misspelt key, the
            nearest key that exists.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        path = _path(first)
        field = f"{source}: {'.'.join(path)}" if path else source
        raise InputError(*_explain(model, first, path, field)) from None


@contextlib.contextmanager
def validated(source: str) -> Iterator[None]:
    """Refuse a file whose values make no record that the block builds.

    Raises:
        InputError: names ``source``, the field and what is wrong.
    """
    try:
        yield
    except ValidationError as error:
        first = error.errors()[0]
        path = ".".join(_path(first))
        raise InputError(_misfit(first), f"{source}: {path or error.title}", "mend it") from None


def check_fields(options: Any, source: str) -> None:
    """Refuse an instance of a dataclass whose values do not suit their annotations.

    Raises:
        InputError: names the field and what is wrong.
    """
    with validated(source):
        _fields_of(type(options))(**{name: getattr(options, name) for name in _hints(options)})


@lru_cache
def _fields_of(cls: type) -> type[BaseModel]:
    fields: Any = {name: (hint, ...) for name, hint in _hints(cls).items()}
    strict = ConfigDict(strict=True, allow_inf_nan=False, extra="forbid")
    return create_model(cls.__name__, __config__=strict, **fields)


def _hints(cls: Any) -> dict[str, Any]:
    hints = get_type_hints(cls if isinstance(cls, type) else type(cls), include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


_SYMBOLS = {"K", "R", "K_std"}  # the only capitalised keys of our files


def _path(error: Any) -> list[str]:
    """Return the keys that lead to an error, the last one as it stands in the file."""
    keys = list(error["loc"])
    named = keys[-1:] if error["type"] in ("extra_forbidden", "missing") else []
    return [str(key) for key in keys[: len(keys) - len(named)] if not _is_union_tag(key)] + [
        str(key) for key in named
    ]


def _is_union_tag(part: object) -> bool:
    """Pydantic adds the type tried ('float', 'list[float]', a class name) to a union's path."""
    if not isinstance(part, str):
        return False
    class_name = part[:1].isupper() and part not in _SYMBOLS
    return "[" in part or part in {"float", "int", "str", "bool"} or class_name


def _explain(
    model: type[BaseModel], error: Any, path: list[str], field: str
) -> tuple[str, str, str]:
    kind, given = error["type"], error.get("input")
    if kind == "extra_forbidden":
        siblings = _keys_at(model, path[:-1])
        near = difflib.get_close_matches(path[-1], siblings, n=1)
        todo = f"did you mean '{near[0]}'" if near else f"the keys are {', '.join(siblings)}"
        return "unknown key", field, todo
    if kind == "missing":
        return "is missing", field, "add it"
    if kind == "value_error":
        what, _, todo = str(error["ctx"]["error"]).partition("; ")
        return what, field, todo or "mend the value"
    if kind == "model_type":
        keys = ", ".join(_keys_at(model, path))
        return f"is not a mapping, got {shown(given)}", field, f"the keys are {keys}"
    return _misfit(error), field, "mend the value"


def _misfit(error: Any) -> str:
    message = error["msg"][0].lower() + error["msg"][1:]
    return f"{message}, got {shown(error.get('input'))}"


def _keys_at(model: type[BaseModel], path: list[str]) -> list[str]:
    current: Any = model
    for part in path:
        fields = getattr(current, "model_fields", {})
        if part not in fields:
            continue
        current = _model_in(fields[part].annotation)
    fields = getattr(current, "model_fields", {})
    return [f.alias or name for name, f in fields.items()]


def _model_in(annotation: Any) -> Any:
    """Return the first record class inside an annotation such as ``Focal | None``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for part in getattr(annotation, "__args__", ()):
        model = _model_in(part)
        if model is not None:
            return model
    return None
