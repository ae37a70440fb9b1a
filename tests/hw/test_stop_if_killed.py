"""A program that dies without a word leaves somebody behind who stops the machine."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tty
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="ports are no files here")

PROGRAM = """
import os, sys
from hw import StopIfKilled
with StopIfKilled(int(sys.argv[1]), b"!", 0.1, b"\\x18"):
    print("begun", flush=True)
    sys.stdin.read(1)
"""


def said(ended_by: str) -> bytes:
    """What is written to the port of a program that ends so."""
    master, slave = os.openpty()
    tty.setraw(slave)
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(slave)],
        pass_fds=(slave,),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=root,
        env=os.environ | {"PYTHONPATH": str(root)},
    ) as program:
        assert program.stdin is not None and program.stdout is not None
        assert program.stdout.readline() == b"begun\n"
        if ended_by == "kill -9":
            program.send_signal(signal.SIGKILL)
        else:
            program.stdin.write(b".")
            program.stdin.flush()
        program.wait()
    os.close(slave)  # now the port is open in nobody but who is left behind
    heard = b""
    try:
        while data := os.read(master, 100):
            heard += data
    except OSError:  # nobody is left
        pass
    os.close(master)
    return heard


def test_a_killed_program_has_its_machine_stopped_and_made_ready() -> None:
    assert said("kill -9") == b"!\x18"


def test_a_program_that_ends_in_order_leaves_nobody_behind() -> None:
    assert said("itself") == b""
