"""Until a browser asks, a view beside a run is an open port: nothing is loaded, nothing is read."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from explore3d.report.watch.asked import HOST, LINGER, asked, over

VIEWER = ("viser", "numpy", "mcap")


def asking(port: int, *words: bytes) -> list[bytes]:
    """What is answered to connections that say those words, one after another."""
    answers = []
    for each in words:
        with socket.create_connection((HOST, port), timeout=20.0) as browser:
            if each:
                browser.sendall(each)
                answers.append(b"".join(iter(lambda: browser.recv(4096), b"")))
    return answers


def test_the_first_question_is_answered_and_the_port_is_free_for_the_viewer() -> None:
    told: list[str] = []
    heard: list[list[bytes]] = []

    def tell(url: str) -> None:
        told.append(url)
        # a browser opens a connection in advance, and says nothing on it
        words = (int(url.rpartition(":")[2]), b"", b"GET / HTTP/1.1\r\n\r\n")
        threading.Thread(target=lambda: heard.append(asking(*words))).start()

    port = asked(0, tell, lambda: False)
    assert port is not None and told == [f"http://{HOST}:{port}"]
    with socket.create_server((HOST, port)):
        pass
    deadline = time.monotonic() + 20.0
    while not heard and time.monotonic() < deadline:
        time.sleep(0.01)
    head, _, page = heard[0][0].partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 200 OK") and f"Content-Length: {len(page)}".encode() in head
    assert b"location.reload()" in page and b"http" not in page


def test_a_port_that_is_taken_is_passed_over_and_nobody_asking_ends_it() -> None:
    with socket.create_server((HOST, 0)) as other:
        taken = int(other.getsockname()[1])
        told: list[str] = []
        assert asked(taken, told.append, lambda: bool(told)) is None
    assert int(told[0].rpartition(":")[2]) > taken


def test_a_view_ends_some_time_after_the_run_and_the_last_look(monkeypatch: pytest.MonkeyPatch) -> None:
    now, looks = [0.0], [True]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    ended = threading.Event()
    is_over = over(ended, lambda: looks[0])
    for t, browser, run_ended, expected in (
        (60.0, False, False, False),
        (100.0, True, True, False),
        (100.0 + LINGER, False, True, False),
        (100.1 + LINGER, False, True, True),
    ):
        now[0], looks[0] = t, browser
        if run_ended:
            ended.set()
        assert is_over() is expected


def test_a_view_that_nobody_asks_for_loads_no_viewer(tmp_path: Path) -> None:
    program = (
        "import sys; from pathlib import Path\n"
        "from explore3d.cli import display; from explore3d.report.watch import asked\n"
        "sys.modules[asked.__module__].LINGER = 0.0\n"
        "display._watch_beside(Path(sys.argv[1]), 0)\n"
        f"print(set({VIEWER}) & sys.modules.keys())"
    )
    done = subprocess.run([sys.executable, "-c", program, str(tmp_path)], stdin=subprocess.DEVNULL, capture_output=True)
    address, loaded = done.stdout.decode().splitlines()
    assert address.startswith("watch: http://") and loaded == "set()", done.stderr
