"""Serve: a process whose compiled parts are loaded; each log gets a copy of it, made in milliseconds by fork.

A fresh process takes two seconds of processor time to load what a log of 400 samples uses for 0.3 s. And a copy of its
own is all that a log can spoil: what crashes, hangs or takes too much memory ends there.

Jobs come as lines of JSON on standard input, answers leave as lines on standard output; when input ends, so does this.
"""

from __future__ import annotations

import json
import os
import resource
import select
import signal
import sys
import time
from typing import Any

from explore3d.jobs.batch.one_log import Job, carried_out
from explore3d.jobs.batch.rehearsal import rehearse

# Ends of a copy that a fault of its own causes; any other signal was sent to it
FAULT_SIGNALS = (signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL)
# Seconds after its time that a copy is left to be ended
GRACE = 5.0
# Bytes that are read from a copy at a time
_READ = 1 << 16


def serve() -> None:
    """Carry out jobs until there are no more."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints is no answer
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the batch's affair
    rehearse(quick=True)  # what that loads and compiles, every copy has
    for line in sys.stdin:
        order = json.loads(line)
        answers.write(json.dumps(_answer(order)) + "\n")


def _answer(order: dict[str, Any]) -> dict[str, Any]:
    """Carry out one job in a copy of this process, within its limits."""
    began = time.perf_counter()
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        _be_the_copy(order, reader, writer)
    os.close(writer)
    late = order["seconds"] is not None and began + order["seconds"]
    content, status = bytearray(), ""
    while True:
        left = None if late is False else max(0.0, late - time.perf_counter())
        ready, _, _ = select.select([reader, sys.stdin.fileno()], [], [], left)
        if reader in ready:
            block = os.read(reader, _READ)
            if not block:
                break
            content += block
        elif ready:  # nobody waits for the answer any more
            os.kill(child, signal.SIGKILL)
            os._exit(0)
        else:
            os.kill(child, signal.SIGKILL)
            status = "out of time"
            break
    os.close(reader)
    _, ended, used = os.wait4(child, 0)
    memory = used.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    spent = {"seconds": round(time.perf_counter() - began, 3), "memory": memory}
    if status:
        return _failed(order, status, f"it was not done after {order['seconds']:g} s", spent)
    if os.WIFSIGNALED(ended):
        number = os.WTERMSIG(ended)
        if number in FAULT_SIGNALS:
            return _failed(order, "crashed", f"a library ended the process ({signal.Signals(number).name})", spent)
        reason = f"somebody, or a system short of memory, ended the process ({signal.Signals(number).name})"
        return _failed(order, "killed", reason, spent)
    if os.WEXITSTATUS(ended) or not content:
        return _failed(order, "crashed", f"the process ended by itself, status {os.WEXITSTATUS(ended)}", spent)
    answer: dict[str, Any] = json.loads(content)
    answer["run"]["memory"] = memory
    return answer


def _failed(order: dict[str, Any], status: str, reason: str, spent: dict[str, Any]) -> dict[str, Any]:
    return {"run": Job.read(order["job"]).row(status, reason, **spent), "features": []}


def _be_the_copy(order: dict[str, Any], reader: int, writer: int) -> None:
    """What the copy does; it does not return."""
    status = 1
    try:
        os.close(reader)
        if order["memory"] is not None:
            # private memory, code and libraries that are mapped do not count
            resource.setrlimit(resource.RLIMIT_DATA, (order["memory"], order["memory"]))
        if order["seconds"] is not None:  # it ends in time even if nobody is left to end it
            signal.setitimer(signal.ITIMER_REAL, order["seconds"] + GRACE)
        answer = carried_out(Job.read(order["job"]))
        with os.fdopen(writer, "w") as out:
            json.dump(answer, out)
        status = 0
    finally:
        os._exit(status)


if __name__ == "__main__":
    serve()
