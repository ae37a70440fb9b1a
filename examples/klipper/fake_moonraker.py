"""A printer that is none: as much of Moonraker's HTTP API as the finger uses; it moves in real time."""

from __future__ import annotations

import json
import re
import threading
import time
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from urllib.parse import parse_qs, urlparse

import numpy as np


class FakePrinter:
    """A context manager that serves on a port of its own, `url`.

    Args:
        height: of the tip's centre over the body at (x, y), all m, machine frame.
        pace: printer seconds per second.
    """

    def __init__(self, height: Callable[[float, float], float], pace: float = 1.0) -> None:
        self.height, self.pace = height, pace
        self.position = np.array([0.1, 0.1, 0.05])
        self.low, self.high = np.zeros(3), np.array([0.2, 0.2, 0.1])
        self.travelled, self.last, self.homed = 0.0, 0.0, "xyz"
        self.shut_down, self.silent, self.nonsense = "", False, False
        self._moving, self._asked = threading.Lock(), 0
        printer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.answer(printer.status())

            def do_POST(self) -> None:
                place = urlparse(self.path)
                if place.path == "/printer/emergency_stop":
                    printer.shut_down = "Shutdown due to webhooks request"
                    self.answer("ok")
                    return
                try:
                    for line in parse_qs(place.query)["script"][0].splitlines():
                        printer.run(line)
                    self.answer("ok")
                except RuntimeError as error:
                    self.answer({"error": {"code": 400, "message": str(error)}}, 400)

            def answer(self, result: object, code: int = 200) -> None:
                while printer.silent:
                    time.sleep(0.01)
                body = json.dumps({"result": result} if code == 200 else result).encode()
                try:
                    self.send_response(code)
                    self.send_header("Content-Length", str(len(body)))
                    self.end_headers()
                    self.wfile.write(body)
                except OSError:  # the host has hung up
                    self.close_connection = True

            def log_message(self, *words: object) -> None: ...

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self.server.server_port}"

    def __enter__(self) -> FakePrinter:
        threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.silent, self.shut_down = False, "end"
        self.vanish()

    def vanish(self) -> None:
        """The network is gone, and Klipper, which nobody talks to any more, ends what it was told to do."""
        self.server.shutdown()
        self.server.server_close()

    def status(self) -> dict[str, object]:
        self._asked += 1
        nonsense = self.nonsense and self._asked % 7 == 0
        head = {
            "position": [*(1e3 * self.position).tolist(), 0.0],
            "homed_axes": self.homed,
            "axis_minimum": [*(1e3 * self.low).tolist(), 0.0],
            "axis_maximum": [*(1e3 * self.high).tolist(), 0.0],
        }
        return {"status": {"toolhead": head, "probe": {"last_z_result": None if nonsense else self.last}}}

    def run(self, line: str) -> None:
        words = {word[0]: float(word[1:]) for word in re.findall(r"\b[XYZF][-\d.]+", line)}
        if line.startswith("G1"):
            target = [1e-3 * words.get(axis, 1e3 * old) for axis, old in zip("XYZ", self.position, strict=True)]
            self.move(np.array(target), words["F"] / 60e3)
        elif line.startswith("PROBE"):
            x, y, z = self.position
            surface = self.height(x, y)
            if z <= surface:
                raise RuntimeError("Probe triggered prior to movement")
            self.move(
                np.array([x, y, max(surface, self.low[2])]), 1e-3 * float(line.split("PROBE_SPEED=")[1].split()[0])
            )
            if surface < self.low[2]:
                raise RuntimeError("No trigger on probe after full movement")
            self.last = 1e3 * surface

    def move(self, target: np.ndarray, speed: float) -> None:
        with self._moving:
            if self.homed != "xyz":
                raise RuntimeError("Must home axis first")
            start, begun = self.position, time.monotonic()
            way = float(np.linalg.norm(target - start))
            while not self.shut_down:
                share = min(1.0, (time.monotonic() - begun) * self.pace * speed / way) if way else 1.0
                here = start + share * (target - start)
                self.travelled += float(np.linalg.norm(here - self.position))
                self.position = here
                if share == 1.0:
                    return
                time.sleep(0.001)
            raise RuntimeError(self.shut_down)
