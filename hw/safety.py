"""Safety: stopping at once on a signal, getting away undisturbed afterwards; and what stops a machine left alone."""

from __future__ import annotations

import _thread
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
# Packages that call back into Python from compiled code, where an exception is lost, takes another name or ends the
# process; and one that takes whatever ends the import of a library for its absence: a Ctrl-C in ten was lost there
_NOT_TO_BE_BROKEN_OFF = ("numba", "llvmlite", "pydantic", "trimesh")
_AGAIN = 0.002  # s until a signal that met them is sent again: kernels may follow each other that closely


def end_program(number: int, frame: FrameType | None) -> None:
    """The handler of a signal that ends the program in order: every `with` block is left by an exception.

    A compiler, a serialiser or a library that is loading others is not broken off, for it would lose or rename the
    exception, or crash; the same signal comes again until it is done (a kernel takes some seconds, once). It comes
    again, too, where Python itself loses the exception: in `__del__`, or in the callback of a weak reference.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        SystemExit: another signal, with 128 + its number.
    """
    if _loses_exceptions(frame):
        _send_again(number)
        return
    if not isinstance(sys.unraisablehook, _SignalsComeAgain):
        sys.unraisablehook = _SignalsComeAgain(sys.unraisablehook)
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + number)


class _SignalsComeAgain:
    """Python's hook for exceptions that nobody can catch: a signal's is sent again, another is told as before."""

    def __init__(self, before: Callable[[sys.UnraisableHookArgs], Any]) -> None:
        self._before = before

    def __call__(self, lost: sys.UnraisableHookArgs) -> None:
        error = lost.exc_value
        code = 128 + signal.SIGINT if isinstance(error, KeyboardInterrupt) else getattr(error, "code", None)
        number = next((each for each in SIGNALS if code == 128 + each), None)
        if number is None:
            self._before(lost)
        else:
            _send_again(number)


_to_send: queue.SimpleQueue[int] = queue.SimpleQueue()
_sender = threading.Thread()  # none yet


def _send_again(number: int) -> None:
    global _sender
    _to_send.put(number)
    if not _sender.is_alive():  # at first, and in a process that was forked off
        _sender = threading.Thread(target=_keep_sending, name="signals that come again", daemon=True)
        _sender.start()


def _keep_sending() -> None:
    while True:
        number = _to_send.get()
        time.sleep(_AGAIN)
        _send(number)


def _send(number: int) -> None:
    if hasattr(signal, "pthread_kill"):  # wakes the main thread where it waits, too
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        _thread.interrupt_main(signal.Signals(number))


def _loses_exceptions(frame: FrameType | None) -> bool:
    """Whether an exception raised here is lost or renamed: compiled code called it, or the hook is sending again.

    On a busy machine the signal may be back before the hook is left, and what a hook raises is printed and gone.
    """
    while frame is not None:
        if frame.f_code is _SignalsComeAgain.__call__.__code__:
            return True
        if frame.f_globals.get("__name__", "").partition(".")[0] in _NOT_TO_BE_BROKEN_OFF:
            return True
        frame = frame.f_back
    return False


class StopOnSignal:
    """While entered, Ctrl-C and SIGTERM stop the machine first and end the program after.

    The first signal calls `stop` at once, in the handler; then the program ends in order (`end_program`), so that
    every `with` block is left. After `ignore()` further ones do nothing: the retreat is not interrupted. Outside of the
    main thread nothing is installed.

    Args:
        stop: halts the machine; must not raise and must not wait.
    """

    def __init__(self, stop: Callable[[str], None]) -> None:
        self._stop = stop
        self._before: dict[int, Any] = {}
        self._stopped = False
        self._ignoring = False

    def __enter__(self) -> StopOnSignal:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._strike) for number in SIGNALS}
        return self

    def ignore(self) -> None:
        """From now on signals do nothing."""
        self._ignoring = True

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before = {}

    def _strike(self, number: int, frame: FrameType | None) -> None:
        if self._ignoring:
            return
        if not self._stopped:  # the same signal may come again, see end_program
            self._stopped = True
            self._stop(f"stopped by {signal.Signals(number).name}")
        end_program(number, frame)


# Waits for a word through its first handle; without one writes to the second: what stops, and, once the machine stands,
# what makes it ready again
_WIDOW = """
import os, sys, time
word, port, stop, stands, ready = sys.argv[1:]
if not os.read(int(word), 1):
    os.write(int(port), bytes.fromhex(stop))
    time.sleep(float(stands))
    os.write(int(port), bytes.fromhex(ready))
"""
# It has been told, and ends, within so many s
_TOLD_WITHIN = 1.0


class StopIfKilled:
    """A small process that stops the machine if this one dies without a word: kill -9, no memory left, a crash.

    A controller carries out what it was told: a stroke of a probe, a motion through free space. Where the port is no
    file (Windows, a socket) there is no such process, and that is what happens.

    Args:
        port: handle of the port, or None.
        stop: bytes that stop the machine.
        stands: s after which it stands.
        ready: bytes that make it ready again.
    """

    def __init__(self, port: int | None, stop: bytes, stands: float, ready: bytes) -> None:
        self._port, self._words = port, [stop.hex(), str(stands), ready.hex()]
        self._process: subprocess.Popen[bytes] | None = None
        self._word = -1

    def __enter__(self) -> StopIfKilled:
        if self._port is None or os.name != "posix":
            return self
        heard, self._word = os.pipe()
        # in a session of its own: a signal to the program's group does not end it
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", "-c", _WIDOW, str(heard), str(self._port), *self._words],
            pass_fds=(heard, self._port),
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(heard)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._process is None:
            return
        try:
            os.write(self._word, b".")
            self._process.wait(_TOLD_WITHIN)
        except (BrokenPipeError, subprocess.TimeoutExpired):  # it was ended by somebody
            self._process.kill()
            self._process.wait()
        finally:
            os.close(self._word)
