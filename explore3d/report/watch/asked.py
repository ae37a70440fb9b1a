"""Waiting for the first browser: until somebody looks, a view beside a run is an open port and nothing else.

The viewer's libraries take 0.8 CPU s to load and a log some 0.5 us a sample to read; a run that nobody looks at need
not pay either.
"""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from collections.abc import Callable

HOST = "127.0.0.1"
# s without a browser after which a view that a run began ends, once that run has
LINGER = 10.0
# Priority of a view beside a run: the finger goes before it
NICE = 10
# s between two looks whether there is still something to wait for
ASKED_EVERY = 0.5
# s for a browser to say what it wants: some open connections in advance, and say nothing on them
SILENCE = 0.5
# Ports that are tried one after another, as the viewer does
PORTS_TRIED = 1000
# Asks again, every 0.2 s, until the viewer answers in the place of this page
WAITING_PAGE = b"""<!doctype html><html lang="en"><meta charset="utf-8"><title>explore3d</title>
<link rel="icon" href="data:,"><p style="font:1rem sans-serif;margin:2rem">The view opens &hellip;</p>
<script>
const again = () => setTimeout(() => fetch("/", {cache: "no-store"}).then(() => location.reload(), again), 200);
again();
</script></html>
"""
ANSWER = (
    b"HTTP/1.1 200 OK\r\nContent-Type: text/html; charset=utf-8\r\nCache-Control: no-store\r\n"
    b"Connection: close\r\nContent-Length: %d\r\n\r\n"
)


def asked(port: int, told: Callable[[str], None], is_over: Callable[[], bool]) -> int | None:
    """Wait until a browser asks, answer it with a page that waits for the viewer, and let go of the port.

    Args:
        port: the first that is tried, of this machine alone; 0: any.
        told: given the address that a browser is to open.
        is_over: asked twice a second whether to wait no longer.

    Returns:
        The port, which is free again; None if nobody asked.

    Raises:
        OSError: no port is free.
    """
    with _listening(port) as listener:
        found = int(listener.getsockname()[1])
        told(address(HOST, found))
        listener.settimeout(ASKED_EVERY)
        while not is_over():
            try:
                visitor = listener.accept()[0]
            except TimeoutError:
                continue
            with visitor:
                if _answered(visitor):
                    return found
    return None


def address(host: str, port: int) -> str:
    """Where a browser finds the view."""
    return f"http://{host}:{port}"


def when_input_ends() -> threading.Event:
    """Set once standard input has ended, as it does with the run that began this program; from now on the run goes
    before this program."""
    ended = threading.Event()
    if hasattr(os, "nice"):
        os.nice(NICE)

    def wait() -> None:
        sys.stdin.buffer.read()
        ended.set()

    threading.Thread(target=wait, daemon=True).start()
    return ended


def over(ended: threading.Event, looks: Callable[[], bool] = lambda: False) -> Callable[[], bool]:
    """Says True once the run has ended and nobody has looked for LINGER."""
    seen = time.monotonic()

    def is_over() -> bool:
        nonlocal seen
        now = time.monotonic()
        seen = now if looks() else seen
        return ended.is_set() and now - seen > LINGER

    return is_over


def _listening(port: int) -> socket.socket:
    for number in range(port, min(port + PORTS_TRIED, 1 << 16)):
        try:
            return socket.create_server((HOST, number))
        except OSError as error:
            trouble = error
    raise trouble


def _answered(visitor: socket.socket) -> bool:
    """False if the visitor left, or said nothing."""
    visitor.settimeout(SILENCE)
    try:
        if not visitor.recv(1 << 16):
            return False
        visitor.sendall(ANSWER % len(WAITING_PAGE) + WAITING_PAGE)
        visitor.shutdown(socket.SHUT_WR)
        visitor.recv(1 << 16)  # the browser closes: its next question goes to the viewer
    except OSError:
        return False
    return True
