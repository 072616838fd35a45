"""Who may talk to the viewer: its own page, and beyond this machine who knows its token.

A browser lets any page open a websocket to any address. What tells them apart is the header
``Origin``, which names the page, and ``Host``, which holds another name where somebody's domain was
pointed at this machine.
"""

import contextlib
import hmac
import http
import ipaddress
import secrets
import socket
from collections.abc import Callable, Iterator
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

COOKIE = "mitsuba-endo"
QUERY = "token"
_NAMES = {"localhost"}
Handle = Callable[[Any, Any], Any]


class Guard:
    """Decides on requests to a server that listens at ``host``."""

    def __init__(self, host: str) -> None:
        self._names = {*_NAMES, host.lower().strip("[]")}
        self.token = None if is_loopback(host) else secrets.token_urlsafe(24)
        """What a request must bring; None where nobody but this machine can ask."""

    def allows(self, request: Any) -> bool:
        """Tell whether a request comes from the viewer's own page and may be answered."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or len(origins) > 1:
            return False
        if origins and urlsplit(origins[0]).netloc.lower() != hosts[0].lower():
            return False
        if self.token is None:
            name = urlsplit(f"//{hosts[0]}").hostname or ""
            return name in self._names or _is_loopback_address(name)
        return any(hmac.compare_digest(said, self.token) for said in _said(request))

    def wrap(self, answer: Handle) -> Handle:
        """Return a function that answers like ``answer`` what is allowed, and refuses the rest."""

        def guarded(connection: Any, request: Any) -> Any:
            try:
                allowed = self.allows(request)
            except ValueError:  # headers that are no address
                allowed = False
            if not allowed:
                return connection.respond(http.HTTPStatus.FORBIDDEN, "FORBIDDEN\n")
            response = answer(connection, request)
            if response is not None and self.token is not None:
                cookie = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
                response.headers["Set-Cookie"] = cookie
            return response

        return guarded


def is_loopback(host: str) -> bool:
    """Tell whether an address to listen at is reached from this machine alone."""
    try:
        addresses = socket.getaddrinfo(host or None, None, flags=socket.AI_PASSIVE)
    except OSError:
        return False
    return bool(addresses) and all(
        _is_loopback_address(str(address[0])) for *_, address in addresses
    )


@contextlib.contextmanager
def guarding(guard: Guard) -> Iterator[None]:
    """Put the guard before every request to the viser server that is started within the block.

    viser offers no way to see requests, so the function with which it starts to listen is replaced
    while it does.
    """
    import websockets.asyncio.server as library  # pyright: ignore[reportMissingImports]

    serve = library.serve

    def serve_guarded(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        answer = process_request or (lambda connection, request: None)
        return serve(*arguments, process_request=guard.wrap(answer), **options)

    library.serve = serve_guarded
    try:
        yield
    finally:
        library.serve = serve


def without_sharing(server: Any) -> None:
    """Take from browsers the means to publish the scene through viser's relay in the internet."""
    from viser import _messages as messages  # pyright: ignore[reportMissingImports]

    for kind in (messages.ShareUrlRequest, messages.ShareUrlDisconnect):
        server._websock_server.unregister_handler(kind)


def _said(request: Any) -> list[str]:
    """Return the tokens that a request brings, in its address and as a cookie."""
    tokens = parse_qs(urlsplit(request.path).query).get(QUERY, [])
    with contextlib.suppress(CookieError):
        for line in request.headers.get_all("Cookie"):
            tokens += [m.value for name, m in SimpleCookie(line).items() if name == COOKIE]
    return [said for said in tokens if said.isascii()]


def _is_loopback_address(name: str) -> bool:
    try:
        return ipaddress.ip_address(name.partition("%")[0]).is_loopback
    except ValueError:
        return False
