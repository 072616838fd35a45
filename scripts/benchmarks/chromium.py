"""A headless Chromium driven over its DevTools protocol: pages as a user's browser sees them."""

import base64
import contextlib
import itertools
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

EXECUTABLE = shutil.which("chromium") or shutil.which("google-chrome")
_FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--hide-scrollbars", "--remote-debugging-port=0",
)  # fmt: skip


@dataclass(eq=False)
class Page:
    """One tab."""

    socket: Any
    requests: list[str] = field(default_factory=list)
    """Addresses asked for, data URIs left out."""
    faults: list[str] = field(default_factory=list)
    """Errors and warnings of the console, and exceptions that nothing caught."""
    _numbers: Iterator[int] = field(default_factory=lambda: itertools.count(1))

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Call a method of the protocol and return its result.

        Raises:
            RuntimeError: the browser answers with an error.
        """
        number = next(self._numbers)
        self.socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self.socket.recv(timeout=60))
            if message.get("id") == number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']['message']}")
                return message["result"]
            self._note(message)

    def open(self, address: str) -> None:
        """Load an address and wait until the page has loaded."""
        self.send("Page.navigate", url=address)
        self.wait_for("document.readyState === 'complete'")

    def evaluate(self, expression: str) -> Any:
        """Return the value of a JavaScript expression; a promise is waited for."""
        result = self.send(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        if "exceptionDetails" in result:
            raise RuntimeError(result["exceptionDetails"].get("text", "exception"))
        return result["result"].get("value")

    def wait_for(self, expression: str, seconds: float = 30.0) -> float:
        """Wait until an expression is true and return the seconds that took.

        Raises:
            TimeoutError: it stays false.
        """
        began = time.perf_counter()
        while time.perf_counter() - began < seconds:
            if self.evaluate(f"Boolean({expression})"):
                return time.perf_counter() - began
            time.sleep(0.05)
        raise TimeoutError(f"still false after {seconds} s: {expression}")

    def click(self, x: float, y: float) -> None:
        """Press and release the left mouse button at a place in the window, CSS pixels."""
        self.send("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        for kind in ("mousePressed", "mouseReleased"):
            self.send(
                "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1
            )  # fmt: skip

    def screenshot(self, path: Path, part: tuple[float, float] | None = None) -> None:
        """Save as PNG what the window shows, or the page from one height to another, CSS pixels."""
        parameters: dict[str, Any] = {}
        if part is not None:
            width = self.send("Page.getLayoutMetrics")["cssContentSize"]["width"]
            clip = {"x": 0, "y": part[0], "width": width, "height": part[1] - part[0], "scale": 1}
            parameters = {"captureBeyondViewport": True, "clip": clip}
        data = self.send("Page.captureScreenshot", format="png", **parameters)["data"]
        path.write_bytes(base64.b64decode(data))

    def _note(self, message: dict[str, Any]) -> None:
        method, given = message.get("method", ""), message.get("params", {})
        if method == "Network.requestWillBeSent":
            address = given["request"]["url"]
            if not address.startswith(("data:", "blob:")):
                self.requests.append(address)
        elif method == "Network.webSocketCreated":
            self.requests.append(given["url"])
        elif method == "Runtime.exceptionThrown":
            details = given["exceptionDetails"]
            self.faults.append(details.get("exception", details).get("description", "exception"))
        elif method == "Runtime.consoleAPICalled" and given["type"] in ("error", "warning"):
            self.faults.append(" ".join(str(a.get("value")) for a in given["args"]))
        elif method == "Log.entryAdded" and given["entry"]["level"] in ("error", "warning"):
            self.faults.append(given["entry"]["text"])


@contextlib.contextmanager
def browser(width: int = 1200, height: int = 800) -> Iterator[Page]:
    """Start a browser with a profile of its own and yield an empty tab.

    Raises:
        RuntimeError: no Chromium is installed, or it does not start.
    """
    from websockets.sync.client import connect  # pyright: ignore[reportMissingImports]

    if EXECUTABLE is None:
        raise RuntimeError("no Chromium is installed")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [
            EXECUTABLE, *_FLAGS, f"--user-data-dir={profile}", f"--window-size={width},{height}",
            "about:blank",
        ]  # fmt: skip
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        try:
            with connect(_address(Path(profile)), max_size=None, proxy=None) as socket:
                page = Page(socket)
                for domain in ("Page", "Runtime", "Network", "Log"):
                    page.send(f"{domain}.enable")
                page.send(
                    "Emulation.setDeviceMetricsOverride", width=width, height=height,
                    deviceScaleFactor=1, mobile=False,
                )  # fmt: skip
                yield page
        finally:
            process.terminate()
            process.wait(10)


def _address(profile: Path) -> str:
    """Return the address of the first tab's socket, which the browser tells when it is ready."""
    from urllib.request import ProxyHandler, build_opener

    file = profile / "DevToolsActivePort"
    opener = build_opener(ProxyHandler({}))
    for _ in range(300):
        if file.exists() and file.read_text():
            port = file.read_text().splitlines()[0]
            with opener.open(f"http://127.0.0.1:{port}/json/list", timeout=10) as answer:
                tabs = [t for t in json.load(answer) if t["type"] == "page"]
            if tabs:
                return tabs[0]["webSocketDebuggerUrl"]
        time.sleep(0.05)
    raise RuntimeError("Chromium does not start")
