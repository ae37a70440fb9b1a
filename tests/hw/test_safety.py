"""A signal ends the program in order, also where it meets compiled code that calls back into Python."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Signals at random moments of compiling: an exception thrown there at once is lost in 8 of 60, or ends the process
COMPILES = """
import random, signal, sys, time
from hw import end_program
number = getattr(signal, sys.argv[1])
signal.signal(number, end_program)
signal.signal(signal.SIGALRM, lambda _, frame: end_program(number, frame))
import numba, numpy
chance, came = random.Random(1), 0
for power in range(12):
    @numba.njit(cache=False)
    def kernel(values, power=power):
        total = 0.0
        for value in numpy.sort(values):
            total += value**power
        return total
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3 * chance.random())
        kernel(numpy.arange(9.0))
        time.sleep(0.4)
    except (KeyboardInterrupt, SystemExit):
        came += 1
print(came, "came")
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there is no timer that sends signals")
@pytest.mark.parametrize("name", ["SIGINT", pytest.param("SIGTERM", marks=pytest.mark.slow)])
def test_a_signal_that_meets_a_compiler_is_neither_lost_nor_deadly(name: str) -> None:
    command = [sys.executable, "-c", COMPILES, name]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert (ended.returncode, ended.stdout) == (0, "12 came\n"), ended.stderr


# Without care some of 20 come as a PydanticSerializationError
SERIALISES = """
import random, signal, sys, time
from pathlib import Path
from hw import end_program
number = getattr(signal, sys.argv[1])
signal.signal(number, end_program)
signal.signal(signal.SIGALRM, lambda _, frame: end_program(number, frame))
from pydantic import BaseModel
class Table(BaseModel):
    paths: list[Path]
table, chance, came = Table(paths=[Path(str(k)) for k in range(1000)]), random.Random(1), 0
for _ in range(20):
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.001 + 0.05 * chance.random())
        while True:
            table.model_dump(mode="json")
            time.sleep(0.001)
    except (KeyboardInterrupt, SystemExit):
        came += 1
print(came, "came")
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="there is no timer that sends signals")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_that_meets_a_serialiser_keeps_its_name(name: str) -> None:
    command = [sys.executable, "-c", SERIALISES, name]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout) == (0, "20 came\n"), ended.stderr


# The signal comes while trimesh asks whether a library is there; without care it counts as a library that is not
LOADS = """
import os, signal, sys, time
from hw import end_program
number = getattr(signal, sys.argv[1])
signal.signal(number, end_program)
class Asked:
    def find_spec(self, name, path=None, target=None):
        if name == "scipy.spatial":
            sys.meta_path.remove(self)
            os.kill(os.getpid(), number)
sys.meta_path.insert(0, Asked())
try:
    import trimesh
    time.sleep(10)
except (KeyboardInterrupt, SystemExit):
    print("came")
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_is_not_taken_for_a_library_that_is_missing(name: str) -> None:
    ended = subprocess.run([sys.executable, "-c", LOADS, name], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout) == (0, "came\n"), ended.stderr


# Python loses what is raised where it clears away, and prints it: without care the program goes on
CLEARS_AWAY = """
import os, signal, sys, threading, time, weakref
from hw import end_program
number = getattr(signal, sys.argv[1])
signal.signal(number, end_program)
def strike(*gone):
    os.kill(os.getpid(), number)
class Kept: ...
class Ends:
    __del__ = strike
def referred():
    kept = Kept()
    reference = weakref.ref(kept, strike)
    del kept
def finalized():
    weakref.finalize(Kept(), strike)
class Slow(threading.Thread):
    def start(self):
        super().start()
        time.sleep(0.05)
if sys.argv[2] == "busy machine":
    threading.Thread = Slow
came = 0
for clear_away in (Ends, referred, finalized):
    try:
        clear_away()
        time.sleep(10)
    except (KeyboardInterrupt, SystemExit) as error:
        came += 1
class Wrong:
    def __del__(self):
        raise SystemExit(3)
Wrong()
print(came, "came")
"""


@pytest.mark.parametrize("machine", ["idle machine", "busy machine"])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_that_python_loses_comes_again_and_what_else_it_loses_is_told(name: str, machine: str) -> None:
    command = [sys.executable, "-c", CLEARS_AWAY, name, machine]
    ended = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout) == (0, "3 came\n"), ended.stderr
    assert ended.stderr.count("Traceback") == 1 and "SystemExit: 3" in ended.stderr
