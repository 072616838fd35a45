"""Reading YAML and JSON against a schema, with errors that name the file and the field."""

import difflib
import json
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from ..errors import InputError


class Record(BaseModel):
    """Base of file records: immutable, unknown keys refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


R = TypeVar("R", bound=BaseModel)


def read_text(path: str | Path) -> str:
    """Read a text file.

    Raises:
        InputError: it does not exist or is not text.
    """
    path = Path(path)
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError("no such file", str(path), "check the path") from None
    except UnicodeDecodeError:
        raise InputError("is not a text file", str(path), "check the path") from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read ({reason})", str(path), "check the path") from None


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Read a YAML mapping."""
    try:
        data = yaml.safe_load(read_text(path))
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f" in line {mark.line + 1}" if mark else ""
        raise InputError(f"is not valid YAML{line}", str(path), "mend its syntax") from None
    if not isinstance(data, dict):
        raise InputError("holds no mapping of keys to values", str(path), "see the rig file docs")
    return data


def read_json(path: str | Path) -> dict[str, Any]:
    """Read a JSON object."""
    try:
        data = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise InputError(
            f"is not valid JSON (line {error.lineno})", str(path), "mend or remake it"
        ) from None
    if not isinstance(data, dict):
        raise InputError("holds no JSON object", str(path), "give a solution or truth file")
    return data


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
        path = [str(p) for p in first["loc"] if not _is_union_tag(p)]
        field = f"{source}: {'.'.join(path)}" if path else source
        raise InputError(*_explain(model, first, path, field)) from None


_SYMBOLS = {"K", "R", "K_std"}  # the only capitalised keys of our files


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
        return f"is not a mapping, got {given!r}", field, f"the keys are {keys}"
    message = error["msg"][0].lower() + error["msg"][1:]
    return f"{message}, got {given!r}", field, "mend the value"


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
        found = _model_in(part)
        if found is not None:
            return found
    return None
