"""Safety: stopping at once on a signal, and getting away undisturbed afterwards."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class StopOnSignal:
    """While entered, Ctrl-C and SIGTERM stop the machine first and end the program after.

    The first signal calls `stop` at once, in the handler, and then raises KeyboardInterrupt (Ctrl-C) or
    SystemExit, so that every `with` block ends in order. After `ignore()` further ones do nothing: the
    retreat is not interrupted. Outside of the main thread nothing is installed.

    Args:
        stop: halts the machine; must not raise and must not wait.
    """

    def __init__(self, stop: Callable[[str], None]) -> None:
        self._stop = stop
        self._before: dict[int, Any] = {}
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
        self._stop(f"stopped by {signal.Signals(number).name}")
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)
