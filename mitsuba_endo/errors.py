"""The one exception for input a user can mend."""

import reprlib
from typing import Any

_SHOWN = 80
"""Characters of a value that a message quotes."""
_LONGEST = 400
"""Characters of a part of a message: paths may be as long as the system allows."""


def shown(value: Any) -> str:
    """Return a value as a message quotes it, cut to what a reader can take in."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = _SHOWN
    try:
        text = short.repr(value)
    except ValueError:  # an integer of thousands of digits
        text = f"a {type(value).__name__}"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."


def _plain(text: str) -> str:
    """Return a text on one line, without what moves a terminal's cursor."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    return "".join(c if c.isprintable() else " " if c.isspace() else repr(c)[1:-1] for c in text)


class InputError(ValueError):
    """Input that the user can mend.

    Its text is one sentence: where (file, field), what is wrong, what to do. Commands print it
    without a traceback and end with exit code 2.

    Args:
        what: what is wrong, with the offending value.
        where: the file and field, e.g. ``rig.yaml: projector.focal``.
        todo: what to do about it.
    """

    exit_code = 2

    def __init__(self, what: str, where: str | None = None, todo: str | None = None) -> None:
        what, where, todo = _plain(what), where and _plain(where), todo and _plain(todo)
        self.what, self.where, self.todo = what, where, todo
        head = f"{where}: {what}" if where else what
        super().__init__(f"{head}; {todo}." if todo else f"{head}.")


class NothingDecodedError(InputError):
    """Images in which no pattern was found (exit code 3): valid input, no result."""

    exit_code = 3
