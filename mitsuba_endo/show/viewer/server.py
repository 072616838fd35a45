"""The viewer's server: starting it, its address, and its end."""

import asyncio
import contextlib
import errno
import io
import logging
import os
import socket
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from ...errors import InputError
from .guard import QUERY, Guard, guarding, without_sharing

TITLE = "mitsuba-endo"
_TAKEN = (errno.EADDRINUSE, errno.EACCES)
_LAST_PORT = 65535
"""Of TCP, whose ports have 16 bits."""
_TOKEN = "mitsuba_endo_token"
"""Attribute of a server: what :func:`address` adds."""


@contextlib.contextmanager
def running_server(host: str, port: int) -> Iterator[Any]:
    """Start viser on ``host`` and the first free port from ``port`` on, and stop it at the end.

    It answers its own page only (see :mod:`.guard`), and beyond this machine who knows its address
    with the token in it.

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
    port, guard = _free_port(host, port), Guard(host)
    with _silent(), guarding(guard):
        server = viser.ViserServer(host=host, port=port, label=TITLE, verbose=False)
    without_sharing(server)
    setattr(server, _TOKEN, guard.token)
    server.gui.configure_theme(
        control_layout="collapsible", control_width="large", show_logo=False,
        show_share_button=False, brand_color=(0, 114, 178),
    )  # fmt: skip
    try:
        yield server
    finally:
        with _silent():
            server.stop()


def _free_port(host: str, port: int) -> int:
    """Return the first port from ``port`` on that can be listened at.

    viser takes every fault for a taken port, and where none of its thousand tries succeeds it waits
    for its own start for ever.

    Raises:
        InputError: ``host`` is no address of this machine, or its ports from there on are taken.
    """
    try:
        with ThreadPoolExecutor(1) as thread:  # the caller may run an event loop, as notebooks do
            return thread.submit(asyncio.run, _first_listening(host, port)).result()
    except OSError as error:
        unknown = isinstance(error, socket.gaierror)
        reason = "no such host" if unknown else os.strerror(error.errno or 0).lower()
        raise InputError(
            f"cannot listen ({reason})", f"{host}:{port}", "give another --host or --port"
        ) from None


async def _first_listening(host: str, port: int) -> int:
    """Return the first port at which asyncio, as viser uses it, can listen."""
    for candidate in range(port, _LAST_PORT + 1):
        try:
            loop = asyncio.get_running_loop()
            server = await loop.create_server(asyncio.Protocol, host, candidate)
        except OSError as error:
            if error.errno not in _TAKEN:
                raise
        else:
            server.close()
            return candidate
    raise OSError(errno.EADDRINUSE, os.strerror(errno.EADDRINUSE))


def address(server: Any) -> str:
    """Return what to type into a browser, with the token where the server asks for one."""
    host = server.get_host()
    host = "localhost" if host in ("0.0.0.0", "::") else host
    plain = f"http://{f'[{host}]' if ':' in host else host}:{server.get_port()}"
    token = getattr(server, _TOKEN, None)
    return f"{plain}/?{QUERY}={token}" if token else plain


def wait_for_interrupt() -> None:
    """Return when the user presses Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            time.sleep(3600)


def _silent() -> contextlib.redirect_stdout[io.StringIO]:
    """Swallow viser's banner: stdout belongs to the command."""
    return contextlib.redirect_stdout(io.StringIO())
