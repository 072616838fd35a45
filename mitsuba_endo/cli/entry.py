"""Entry point of ``mitsuba-endo``: sees to Ctrl-C and SIGTERM before anything else is loaded."""

import signal
import sys
import weakref
from types import FrameType

from ..memory import left

EXIT_INTERRUPTED = 130
"""128 plus the number of SIGINT, as shells report it."""
INTERRUPTED = "interrupted; no output was left half written."
EXIT_MEMORY = 71
"""The system gives no more memory, threads or files (EX_OSERR of sysexits.h)."""
SHORT = (
    "the system gives no more memory or threads; close other programs, or raise the limit "
    "(`ulimit -v`, `ulimit -u`)."
)
LEAST_MEMORY = 900 << 20
"""Bytes of address space: below, libraries end the process by a signal, or hang, when loaded."""
_SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGALRM") if hasattr(signal, name)
]
RETRY = 0.05
"""Seconds after which an interrupt that came while a module was loaded is tried again."""
LOADER = "<frozen importlib._bootstrap>"
CALLBACKS = weakref.__file__
"""Functions that Python calls when an object goes; what they raise is printed and lost."""


def main() -> None:
    """Run the command line."""
    _see_to_interrupts()
    free = left()
    if free is not None and free < LEAST_MEMORY:
        print(f"error: {SHORT}", file=sys.stderr)
        sys.exit(EXIT_MEMORY)
    try:
        from .main import app

        app()
    except KeyboardInterrupt:
        print(f"error: {INTERRUPTED}", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)
    finally:
        _let_end()


def _see_to_interrupts() -> None:
    # Where a signal is ignored, as Ctrl-C in a background job of a script, it stays ignored.
    # Windows has no alarm by which to try again.
    if not hasattr(signal, "setitimer"):
        return
    for number in _SIGNALS:
        if signal.getsignal(number) in (signal.default_int_handler, signal.SIG_DFL):
            signal.signal(number, interrupt_after_loading)
    sys.unraisablehook = _again_if_lost


def _let_end() -> None:
    """Ignore signals while the interpreter ends: what was to be done is done, and said."""
    for number in _SIGNALS:
        if signal.getsignal(number) is interrupt_after_loading:
            signal.signal(number, signal.SIG_IGN)


def _again_if_lost(lost: "sys.UnraisableHookArgs") -> None:
    """Try an interrupt again that came where Python has nobody to raise it to.

    Callbacks of weak references, of C code and of the garbage collector are such places.
    """
    if issubclass(lost.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, RETRY)
    else:
        sys.__unraisablehook__(lost)


def interrupt_after_loading(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, but not while a module is being loaded: then try again later.

    Libraries load optional ones within ``except BaseException``: there an interrupt was lost and
    the command went on, or a module was left half made. It is lost likewise while an object goes.
    """
    while frame is not None:
        code = frame.f_code
        if code.co_filename in (LOADER, CALLBACKS) or code.co_name == "__del__":
            signal.setitimer(signal.ITIMER_REAL, RETRY)
            return
        frame = frame.f_back
    raise KeyboardInterrupt
