"""Libraries written in C say on stderr what their exceptions say too, or what nobody asked."""

import contextlib
import os
import threading
from collections.abc import Iterator

_STDERR = 2
"""File descriptor, by POSIX."""
_lock = threading.RLock()


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Send what the process prints on stderr nowhere, for the time of one call of a library."""
    with _lock, contextlib.ExitStack() as at_end:
        try:
            real = os.dup(_STDERR)
            at_end.callback(os.close, real)
            nowhere = os.open(os.devnull, os.O_WRONLY)
            at_end.callback(os.close, nowhere)
        except OSError:  # no stderr at all
            yield
            return
        os.dup2(nowhere, _STDERR)
        try:
            yield
        finally:
            os.dup2(real, _STDERR)
