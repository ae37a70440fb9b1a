"""A headless Chromium, spoken to by its own protocol: pages, clicks, keys, what was fetched and what was complained of.

Reference: https://chromedevtools.github.io/devtools-protocol
"""

from __future__ import annotations

import base64
import itertools
import json
import re
import shutil
import subprocess
import tempfile
import time
from types import TracebackType
from typing import Any

PATIENCE = 240.0  # s: of a busy machine without a graphics card
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
OPTIONS = ("--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
OPTIONS += ("--disable-background-networking", "--disable-component-update", "--no-first-run", "--disable-extensions")


def chromium() -> str | None:
    """The program, None if there is none."""
    return next((found for name in PROGRAMS if (found := shutil.which(name)) is not None), None)


class Browser:
    """One page; a context manager.

    Args:
        width, height: of the page, px.
    """

    def __init__(self, width: int = 1000, height: int = 700) -> None:
        self.fetched: list[str] = []
        self.complaints: list[str] = []
        self._numbers = itertools.count(1)
        self._size = f"--window-size={width},{height}"

    def __enter__(self) -> Browser:
        from websockets.sync.client import connect

        self._profile = tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True)
        program = chromium()
        assert program is not None
        command = [program, *OPTIONS, self._size, f"--user-data-dir={self._profile.name}", "--remote-debugging-port=0"]
        self._process = subprocess.Popen([*command, "about:blank"], stderr=subprocess.PIPE, text=True)
        assert self._process.stderr is not None
        heard = (re.search(r"DevTools listening on (ws://\S+)", line) for line in self._process.stderr)
        address = next(each[1] for each in heard if each)
        self._socket = connect(address, max_size=None, open_timeout=PATIENCE)
        self._session: str | None = None
        pages = [each for each in self.tell("Target.getTargets")["targetInfos"] if each["type"] == "page"]
        attached = self.tell("Target.attachToTarget", targetId=pages[0]["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.tell(f"{domain}.enable")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._socket.close()
        self._process.terminate()
        self._process.wait(PATIENCE)
        self._profile.cleanup()

    def tell(self, method: str, **settings: Any) -> dict[str, Any]:
        """One command and its answer; what happens meanwhile is noted."""
        number = next(self._numbers)
        message = {"id": number, "method": method, "params": settings}
        self._socket.send(json.dumps(message | ({"sessionId": self._session} if self._session else {})))
        while True:
            heard = json.loads(self._socket.recv(PATIENCE))
            if heard.get("id") == number:
                assert "error" not in heard, f"{method}: {heard['error']}"
                return dict(heard["result"])
            self._note(heard.get("method", ""), heard.get("params", {}))

    def _note(self, method: str, about: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            self.fetched.append(about["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.fetched.append(about["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(about["exceptionDetails"]["text"])
        elif method == "Runtime.consoleAPICalled" and about["type"] in ("error", "warning"):
            self.complaints.append(" ".join(str(each.get("value", "")) for each in about["args"]))
        elif method == "Log.entryAdded":
            self.complaints.append(about["entry"]["text"])

    def open(self, address: str) -> None:
        """Go to an address."""
        self.tell("Page.navigate", url=address)

    def ask(self, expression: str) -> Any:
        """The value of an expression on the page."""
        return self.tell("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def until(self, expression: str, seconds: float = PATIENCE) -> Any:
        """Its value once it is something, else None after so many seconds."""
        deadline = time.monotonic() + seconds
        while not (value := self.ask(expression)) and time.monotonic() < deadline:
            time.sleep(0.2)
        return value or None

    def click(self, x: float, y: float) -> None:
        """A click at a place of the page, px."""
        self.tell("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        for kind in ("mousePressed", "mouseReleased"):
            self.tell("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def picture(self) -> bytes:
        """PNG of the page as it is."""
        return base64.b64decode(self.tell("Page.captureScreenshot")["data"])
