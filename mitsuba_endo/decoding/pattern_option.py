"""The coded grid that a command names, e.g. ``pattern:coded?seed=3&width=480``."""

from pydantic import ValidationError

from ..description import read_description
from ..errors import InputError
from .grid_pattern import CodedGrid

OPTION = "--pattern"


def coded_grid(description: str, width: int, height: int) -> CodedGrid:
    """Return the coded grid of a description; its size is that of the rig's projector.

    Args:
        description: as for a scene's ``pattern``.
        width: of the rig's pattern, pattern pixels.
        height: of the rig's pattern.

    Raises:
        InputError: another pattern, unknown settings, or a size that is not the rig's.
    """
    name, settings = read_description(description, "pattern", OPTION)
    if name != "coded":
        raise InputError(
            f"pattern {name!r} has no code", OPTION, "give pattern:coded?..., as it is projected"
        )
    rig = {"width": width, "height": height}
    try:
        pattern = CodedGrid(**{**rig, **settings})  # pyright: ignore[reportArgumentType]
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            f"{first['msg'][0].lower()}{first['msg'][1:]}, not {first['input']!r}",
            f"{OPTION}: {'.'.join(str(part) for part in first['loc'])}",
            f"the parameters are {', '.join(CodedGrid.__dataclass_fields__)}",
        ) from None
    if (pattern.width, pattern.height) != (width, height):
        raise InputError(
            f"is {pattern.width} x {pattern.height} pixels and the rig's projector.width x "
            f"projector.height {width} x {height}", OPTION, "give the size that is projected",
        )  # fmt: skip
    pattern.code  # noqa: B018  # pyright: ignore[reportUnusedExpression]  refuses early
    return pattern
