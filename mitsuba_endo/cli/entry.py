"""Entry point of ``mitsuba-endo``: sees to Ctrl-C before anything else is loaded."""

import signal
import sys
import threading
from types import FrameType

EXIT_INTERRUPTED = 130
INTERRUPTED = "interrupted; no output was left half written."
RETRY = 0.05
"""Seconds after which an interrupt that came while a module was loaded is tried again."""
LOADER = "<frozen importlib._bootstrap>"


def main() -> None:
    """Run the command line."""
    # Where Ctrl-C is ignored, as in a background job of a script, it stays ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt_after_loading)
    try:
        from .main import app

        app()
    except KeyboardInterrupt:
        print(f"error: {INTERRUPTED}", file=sys.stderr)
        sys.exit(EXIT_INTERRUPTED)


def interrupt_after_loading(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt, but not while a module is being loaded: then try again later.

    Libraries load optional ones within ``except BaseException``: there an interrupt was lost and
    the command went on, or a module was left half made.
    """
    while frame is not None:
        if frame.f_code.co_filename == LOADER:
            later = threading.Timer(RETRY, _interrupt_main_thread)
            later.daemon = True
            later.start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt


def _interrupt_main_thread() -> None:
    main_thread = threading.main_thread().ident
    if main_thread is not None and hasattr(signal, "pthread_kill"):
        signal.pthread_kill(main_thread, signal.SIGINT)  # wakes it from sleep, too
    else:
        signal.raise_signal(signal.SIGINT)
