"""The viewer answers its own page and nobody else's.

Oracle: HTTP status codes that a client gets which sends what a browser would send.
"""

import contextlib
import http.client
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest

pytest.importorskip("viser")
from mitsuba_endo.records.calibration import Calibration
from mitsuba_endo.show.viewer import address, open_viewer, running_server
from mitsuba_endo.show.viewer.guard import COOKIE, Guard, is_loopback
from scripts.benchmarks.chromium import EXECUTABLE, browser
from tests.show.conftest import make_calibration  # noqa: F401  a fixture

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
PORT = 18280
FORBIDDEN, OK, SWITCHING = 403, 200, 101


@pytest.fixture
def local() -> Iterator[Any]:
    with running_server("localhost", PORT) as server:
        yield server


@pytest.fixture
def everywhere() -> Iterator[Any]:
    with running_server("0.0.0.0", PORT) as server:
        yield server


@dataclass(frozen=True)
class Answer:
    status: int
    cookie: str


def _ask(server: Any, path: str = "/", **headers: str) -> Answer:
    connection = http.client.HTTPConnection("localhost", server.get_port(), timeout=10)
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    with contextlib.closing(connection):
        connection.putrequest("GET", path, skip_host="Host" in named)
        for name, value in named.items():
            connection.putheader(name, value)
        connection.endheaders()
        with connection.getresponse() as response:
            return Answer(response.status, response.getheader("Set-Cookie") or "")


def _websocket(server: Any, **headers: str) -> int:
    import viser

    upgrade = {
        "Upgrade": "websocket", "Connection": "Upgrade", "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec_WebSocket_Protocol": f"viser-v{viser.__version__}",
    }  # fmt: skip
    return _ask(server, **(upgrade | headers)).status


def test_own_page_is_served(local: Any):
    own = f"localhost:{local.get_port()}"
    assert _ask(local).status == OK
    assert _websocket(local, Origin=f"http://{own}") == SWITCHING
    numbered = f"127.0.0.1:{local.get_port()}"
    assert _websocket(local, Host=numbered, Origin=f"http://{numbered}") == SWITCHING


@pytest.mark.parametrize(
    "origin",
    ["https://evil.example", "http://localhost:1", "null", "http://evil.example:18280", "["],
)
def test_page_of_another_origin_gets_nothing(local: Any, origin: str):
    assert _websocket(local, Origin=origin) == FORBIDDEN
    assert _ask(local, Origin=origin).status == FORBIDDEN


@pytest.mark.parametrize("host", ["evil.example", "localhost.evil.example:80", "", "10.1.2.3", "["])
def test_name_that_somebody_pointed_here_gets_nothing(local: Any, host: str):
    """DNS rebinding: the page's own domain resolves to this machine, so that its origin fits."""
    assert _websocket(local, Host=host, Origin=f"http://{host}") == FORBIDDEN
    assert _ask(local, Host=host).status == FORBIDDEN


def test_beyond_the_loopback_a_token_is_asked_for(everywhere: Any):
    token = parse_qs(urlsplit(address(everywhere)).query)["token"][0]
    assert len(token) >= 32
    assert _ask(everywhere).status == FORBIDDEN
    assert _ask(everywhere, "/?token=guess").status == FORBIDDEN
    assert _websocket(everywhere) == FORBIDDEN
    assert _websocket(everywhere, Cookie=f"{COOKIE}=guess") == FORBIDDEN
    page = _ask(everywhere, f"/?token={token}")
    assert page.status == OK
    cookie, *rest = page.cookie.split("; ")
    assert {"HttpOnly", "SameSite=Strict"} <= set(rest)
    assert _websocket(everywhere, Cookie=cookie) == SWITCHING
    foreign = {"Cookie": cookie, "Origin": "https://evil.example"}
    assert _websocket(everywhere, **foreign) == FORBIDDEN


def test_every_server_has_a_token_of_its_own():
    assert len({Guard("0.0.0.0").token for _ in range(4)}) == 4
    assert Guard("127.0.0.1").token is None


@pytest.mark.parametrize(
    ("host", "local"),
    [("localhost", True), ("127.0.0.9", True), ("::1", True), ("0.0.0.0", False), ("::", False),
     ("", False), ("192.0.2.1", False), ("nowhere.invalid", False)],
)  # fmt: skip
def test_loopback(host: str, local: bool):
    """Oracle: RFC 1122 and RFC 4291."""
    assert is_loopback(host) is local


def test_two_hosts_or_two_origins_are_refused():
    """Oracle: RFC 9112: a request with two hosts is invalid."""
    twice = {"Host": ["localhost:1", "evil.example"], "Origin": []}
    request = SimpleNamespace(path="/", headers=SimpleNamespace(get_all=twice.__getitem__))
    assert not Guard("localhost").allows(request)


def test_no_browser_can_ask_for_a_public_share(local: Any):
    """Oracle: viser's own table of what it does with messages."""
    from viser import _messages

    handlers = local._websock_server._incoming_handlers
    assert handlers
    assert not {_messages.ShareUrlRequest, _messages.ShareUrlDisconnect} & set(handlers)


HOSTILE = (
    '</script><img src=x onerror="window.hit=1"><script>window.hit=2</script>{window.hit=3}'
    " [a](javascript:window.hit=4) `${window.hit=5}` **bold** map_1.exr"
)


def _hostile(calibration: Calibration) -> Calibration:
    said = {"verdict": [HOSTILE], "warnings": [f"left out {HOSTILE}"]}
    frames = [
        frame.model_copy(update={"name": f"{HOSTILE}{k}"})
        for k, frame in enumerate(calibration.solution.frames)
    ]
    solution = calibration.solution.model_copy(update={**said, "frames": frames})
    return replace(calibration, solution=solution)


def test_nothing_said_reaches_markdown(
    local: Any, monkeypatch: pytest.MonkeyPatch,
    make_calibration: Callable[..., Calibration],  # noqa: F811
):  # fmt: skip
    """Oracle: viser's own interface: no Markdown at all, and no tag of the text in any HTML."""
    told: list[str] = []
    add_html = local.gui.add_html
    monkeypatch.setattr(local.gui, "add_html", lambda text: told.append(text) or add_html(text))
    monkeypatch.setattr(local.gui, "add_markdown", lambda *a, **k: pytest.fail("Markdown"))
    open_viewer(local, _hostile(make_calibration(width=64, height=46, count=2)))
    assert any("onerror" in text for text in told)
    assert not any("<img" in text or "<script" in text for text in told)


@pytest.mark.skipif(EXECUTABLE is None, reason="no chromium installed")
@pytest.mark.parametrize("host", ["localhost", "0.0.0.0"])
def test_nothing_said_runs_in_a_browser(
    host: str, make_calibration: Callable[..., Calibration]  # noqa: F811
):  # fmt: skip
    """Oracle: chromium: the text is there letter by letter, and no part of it ran."""
    with running_server(host, PORT) as server, browser(1000, 700) as page:
        open_viewer(server, _hostile(make_calibration(width=64, height=46, count=2)))
        page.open(address(server))
        page.wait_for("document.body.innerText.includes('converged')", 60)
        page.evaluate(
            "[...document.querySelectorAll('*')].filter(e => e.innerText == 'Verdict')"
            ".forEach(e => e.click())"
        )
        page.wait_for("document.body.innerHTML.includes('onerror')", 20)
        assert page.evaluate("window.hit === undefined")
