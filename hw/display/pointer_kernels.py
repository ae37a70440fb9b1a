"""Functions and arrays behind addresses, for compiled code (numba)."""

from __future__ import annotations

from ctypes import CDLL, c_void_p, cast
from math import pi, sin
from typing import Any

from numba import carray, cfunc, int32, int64, njit, types
from numba.extending import intrinsic

CALL = int32(int64, int64)


class Function(types.WrapperAddressProtocol):  # type: ignore[misc]
    """A C function `int32_t f(int64_t, int64_t)` at an address, which compiled code may be handed."""

    def __init__(self, address: int) -> None:
        self._address = address

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        """Of the function."""
        return CALL


def clock_function() -> Function:
    """clock_gettime of the C library.

    Raises:
        AttributeError: this system has none.
    """
    return Function(int(cast(CDLL(None).clock_gettime, c_void_p).value or 0))


def sleep_function() -> Function:
    """nanosleep of the C library.

    Raises:
        AttributeError: this system has none.
    """
    return Function(int(cast(CDLL(None).nanosleep, c_void_p).value or 0))


@intrinsic
def pointer(typing_context, address):  # type: ignore[no-untyped-def]
    """An address as a pointer to double."""
    signature = types.CPointer(types.float64)(types.int64)

    def generate(context, builder, sig, given):  # type: ignore[no-untyped-def]
        return builder.inttoptr(given[0], context.get_value_type(sig.return_type))

    return signature, generate


# The header of a simulated device's state, float64 each: what simulated.py fills in
STATE_HEADER = 32
AT_STEP, AT_STEPS, AT_FAULT, AT_FAULT_STEP = 0, 1, 2, 3
AT_POSITION, AT_VELOCITY, AT_FORCE = 4, 7, 10
AT_ADVANCE = 13  # a11 a12 a21 a22 b1 b2 of one period
AT_GRIP = 19  # stiffness of the hand, N/m
AT_TREMOR = 20  # amplitude, m, and angle per period, rad
SILENT, FROZEN, UNPLUGGED = 1.0, 2.0, 3.0


@njit(cache=True)  # type: ignore[untyped-decorator]
def advance(state: Any, wish: Any) -> None:
    """One period of a mass with damping, held by a spring to where the hand wishes to be, under a constant force."""
    for k in range(3):
        x, v = state[AT_POSITION + k], state[AT_VELOCITY + k]
        # the directions tremble out of step, by a third of a turn
        tremor = state[AT_TREMOR] * sin(state[AT_TREMOR + 1] * state[AT_STEP] + 2.0 * pi / 3.0 * k)
        push = state[AT_FORCE + k] + state[AT_GRIP] * (wish[k] + tremor)
        state[AT_POSITION + k] = state[AT_ADVANCE] * x + state[AT_ADVANCE + 1] * v + state[AT_ADVANCE + 4] * push
        state[AT_VELOCITY + k] = state[AT_ADVANCE + 2] * x + state[AT_ADVANCE + 3] * v + state[AT_ADVANCE + 5] * push


@cfunc(CALL, cache=True)  # type: ignore[untyped-decorator]
def read_simulated(state: int, place: int) -> int:
    """The next sample of a simulated device: its hand moves on by one period first."""
    header = carray(pointer(state), STATE_HEADER)
    step, steps = int(header[AT_STEP]), int(header[AT_STEPS])
    at_fault = header[AT_FAULT] > 0.0 and step >= header[AT_FAULT_STEP]
    if at_fault and header[AT_FAULT] == UNPLUGGED:
        return -1
    whole = carray(pointer(state), STATE_HEADER + 3 * steps)
    row = STATE_HEADER + 3 * min(step, steps - 1)
    advance(header, whole[row : row + 3])
    header[AT_STEP] = step + 1.0
    if at_fault and header[AT_FAULT] == SILENT:
        return 1
    if at_fault:
        return 0
    out = carray(pointer(place), 3)
    for k in range(3):
        out[k] = header[AT_POSITION + k]
    return 0


@cfunc(CALL, cache=True)  # type: ignore[untyped-decorator]
def write_simulated(state: int, place: int) -> int:
    """The force of a simulated device from now on."""
    header, force = carray(pointer(state), STATE_HEADER), carray(pointer(place), 3)
    for k in range(3):
        header[AT_FORCE + k] = force[k]
    return 0
