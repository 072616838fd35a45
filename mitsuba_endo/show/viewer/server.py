"""The viewer's server: starting it, its address, and its end."""

import contextlib
import io
import logging
import time
from collections.abc import Iterator
from typing import Any

from ...errors import InputError

TITLE = "mitsuba-endo"


@contextlib.contextmanager
def running_server(host: str, port: int) -> Iterator[Any]:
    """Start viser on ``host`` and the first free port from ``port`` on, and stop it at the end.

    Raises:
        InputError: viser is not installed, or the address cannot be used.
    """
    try:
        import viser  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError(
            "viser is not installed", "viewer", 'run pip install "mitsuba-endo[view]"'
        ) from None
    # A browser that leaves while it connects is no fault to show a traceback for.
    logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
    with _silent():
        try:
            server = viser.ViserServer(host=host, port=port, label=TITLE, verbose=False)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise InputError(
                f"cannot listen ({reason})", f"{host}:{port}", "give another --host or --port"
            ) from None
    server.gui.configure_theme(
        control_layout="collapsible", control_width="large", show_logo=False,
        show_share_button=False, brand_color=(0, 114, 178),
    )  # fmt: skip
    try:
        yield server
    finally:
        with _silent():
            server.stop()


def address(server: Any) -> str:
    """Return what to type into a browser."""
    host = server.get_host()
    return f"http://{'localhost' if host == '0.0.0.0' else host}:{server.get_port()}"


def wait_for_interrupt() -> None:
    """Return when the user presses Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            time.sleep(3600)


def _silent() -> contextlib.redirect_stdout[io.StringIO]:
    """Swallow viser's banner: stdout belongs to the command."""
    return contextlib.redirect_stdout(io.StringIO())
