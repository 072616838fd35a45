"""What went wrong, as one sentence and an exit code."""

import errno

from ..errors import InputError, shown
from .entry import EXIT_MEMORY, SHORT

EXIT_INPUT = 2
"""The code of usage errors, as Typer and most Unix commands give it."""
_SYSTEM = {
    errno.ENOSPC: "make room", errno.EDQUOT: "make room", errno.EFBIG: "raise `ulimit -f`",
    errno.EROFS: "choose another folder", errno.EACCES: "choose another folder",
    errno.EPERM: "choose another folder", errno.EIO: "look after the disk",
    errno.ENAMETOOLONG: "choose a shorter name",
}  # fmt: skip
"""What the user can mend of what the system reports, and how."""
_RESOURCES = {errno.ENOMEM, errno.EAGAIN, errno.EMFILE, errno.ENFILE}
_THREADS = ("can't start new thread", "bad_alloc", "out of memory", "cannot allocate memory",
            "failed to map segment", "resource temporarily unavailable")  # fmt: skip
"""How Python, C++, Dr.Jit and the loader say that there is no more."""


def sentence(error: BaseException) -> tuple[str, int] | None:
    """Return what to say and the exit code, or None for a fault of the program's own."""
    if isinstance(error, InputError):
        return str(error), error.exit_code
    if _is_shortage(error):
        return SHORT, EXIT_MEMORY
    if isinstance(error, OSError) and error.errno in _SYSTEM:
        reason = (error.strerror or str(error)).lower()
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}the system says {reason}; {_SYSTEM[error.errno]}.", EXIT_INPUT
    return None


def internal(error: BaseException, debug: bool) -> str:
    """Return the sentence of a fault of the program's own."""
    hint = "please report it" if debug else "see it with --debug, and please report it"
    said = shown(str(error))[1:-1].replace("\\n", " ")
    return f"internal fault ({type(error).__name__}: {said}); {hint}."


def _is_shortage(error: BaseException) -> bool:
    link: BaseException | None = error
    while link is not None:
        said = str(link).lower()
        if isinstance(link, MemoryError) or any(words in said for words in _THREADS):
            return True
        if isinstance(link, OSError) and link.errno in _RESOURCES:
            return True
        link = link.__cause__ or link.__context__
    return False
