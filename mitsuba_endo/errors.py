"""The one exception for input a user can mend."""


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
        self.what, self.where, self.todo = what, where, todo
        head = f"{where}: {what}" if where else what
        super().__init__(f"{head}; {todo}." if todo else f"{head}.")


class NothingDecodedError(InputError):
    """Images in which no pattern was found (exit code 3): valid input, no result."""

    exit_code = 3
