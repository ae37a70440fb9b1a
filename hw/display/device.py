"""Display: the one interface that simulated and real force-feedback devices share."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import CFUNCTYPE, POINTER, c_double, c_int32, c_int64, c_void_p, cast
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, runtime_checkable

import numpy as np

from mapping import FloatArray

# What `read` answers
NEW, NOTHING_NEW, LOST = 0, 1, -1


@dataclass(frozen=True, eq=False)
class Calls:
    """A device as two C functions, which the compiled loop calls without Python.

        int32_t read(int64_t state, int64_t position)    writes double[3], m; 0 new, 1 nothing new, below 0 lost
        int32_t write(int64_t state, int64_t force)      takes double[3], N; 0 done, below 0 lost

    Both return at once: a `read` that waits for its device stops the loop, and the guard then writes zero.

    Args:
        read, write: addresses of the functions.
        state: handed to both as it is.
        keep: what must live as long as the addresses are used.
        returns: True of simulated functions: they cannot hang, and each sample is a period after the one before.
    """

    read: int
    write: int
    state: int
    keep: Any = None
    returns: bool = False


@runtime_checkable
class Display(Protocol):
    """A device that tells where it is held and pulls; a context manager that always leaves it without force."""

    @property
    def rate(self) -> float:
        """Steps per second that it is made for."""
        ...

    @property
    def max_force(self) -> float:
        """Largest force, N: of the device or of what is thought safe, whichever is less."""
        ...

    @property
    def damping(self) -> float:
        """Least physical damping of its mechanism in any direction, N s/m: what Colgate's limit rests on."""
        ...

    @property
    def resolution(self) -> float:
        """Step of its positions, m; 0 of one whose positions never repeat unless it is frozen.

        A device with a step must itself answer NOTHING_NEW while it has no new sample.
        """
        ...

    @property
    def info(self) -> dict[str, Any]:
        """What it is: kind, versions, rates; JSON values only."""
        ...

    def calls(self) -> Calls:
        """Its two functions; `python_calls` makes them of methods, at the price of Python in each step.

        Raises:
            FingerError: it is not open, or was lost.
        """
        ...

    def __enter__(self) -> Display: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None: ...


def python_calls(read: Callable[[], FloatArray | None], write: Callable[[FloatArray], None]) -> Calls:
    """The functions of a device that is driven from Python.

    Args:
        read: (3,) position, m, or None if there is nothing new; raises an OSError when the device is lost.
        write: takes (3,) N; raises an OSError when the device is lost.
    """

    def reading(state: int, place: int) -> int:
        try:
            position = read()
        except OSError:
            return LOST
        if position is None:
            return NOTHING_NEW
        np.ctypeslib.as_array(cast(place, POINTER(c_double)), (3,))[:] = position
        return NEW

    def writing(state: int, place: int) -> int:
        try:
            write(np.ctypeslib.as_array(cast(place, POINTER(c_double)), (3,)).copy())
        except OSError:
            return LOST
        return NEW

    kind = CFUNCTYPE(c_int32, c_int64, c_int64)
    first, second = kind(reading), kind(writing)
    return Calls(_address(first), _address(second), 0, (first, second))


def _address(function: Any) -> int:
    return int(cast(function, c_void_p).value or 0)
