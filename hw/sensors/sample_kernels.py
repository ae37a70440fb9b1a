"""Compiled reading and judging of samples that came together: 5000 a second, each judged, take a fiftieth of a core."""

# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mapping import FloatArray, IntArray

# A whole number of so many digits, and the power of ten below it, are exact: their quotient is the float nearest to the
# decimal, as Python reads it
PLAIN_DIGITS = 15
DECIMAL_POWERS = 10.0 ** np.arange(PLAIN_DIGITS + 1)


@njit(cache=True)
def whole_frames(block: NDArray[np.uint8], header: NDArray[np.uint8], length: int) -> bool:
    """Whether a block (N * length,) is of frames that begin with a header and end with the sum of their bytes before.

    The sum has 16 bits, the upper byte first.
    """
    for first in range(0, len(block), length):
        for at in range(len(header)):
            if block[first + at] != header[at]:
                return False
        total = 0
        for at in range(first, first + length - 2):
            total += int(block[at])
        if (total & 0xFFFF) != (int(block[first + length - 2]) << 8 | int(block[first + length - 1])):
            return False
    return True


@njit(cache=True)
def read_frames(
    block: NDArray[np.uint8], doubtful: int, scale: FloatArray, counts: IntArray, forces: FloatArray
) -> bool:
    """Counters and forces of OptoForce frames (16 N,) into `counts` (N,) and `forces` (N, 3), N.

    False, if the status of one has a bit of `doubtful`.

    Args:
        scale: (3,) N per count.
    """
    for row in range(len(counts)):
        first = 16 * row
        if (int(block[first + 6]) << 8 | int(block[first + 7])) & doubtful:
            return False
        counts[row] = int(block[first + 4]) << 8 | int(block[first + 5])
        for axis in range(3):
            at = first + 8 + 2 * axis
            value = int(block[at]) << 8 | int(block[at + 1])
            forces[row, axis] = (value - 65536 if value > 32767 else value) * scale[axis]
    return True


@njit(cache=True)
def read_lines(block: NDArray[np.uint8], counts: IntArray, forces: FloatArray) -> bool:
    """Counts and forces of lines F,<count>,<fx>,<fy>,<fz>*<hh> into `counts` (N,) and `forces` (N, 3), N.

    False, if one is not whole, or has a number that is no plain decimal of at most PLAIN_DIGITS.

    Args:
        block: the lines, each with an LF behind it, which ends every loop.
    """
    at = 0
    for row in range(len(counts)):
        first = at
        if block[at] != ord("F") or block[at + 1] != ord(","):
            return False
        at += 2
        for field in range(4):
            negative = block[at] == ord("-")
            at += int(negative)
            value, digits, decimals, fraction = 0, 0, 0, False
            while True:
                byte = int(block[at])
                if ord("0") <= byte <= ord("9"):
                    value, digits, decimals = 10 * value + byte - ord("0"), digits + 1, decimals + int(fraction)
                elif byte == ord(".") and not fraction:
                    fraction = True
                else:
                    break
                at += 1
            if digits == 0 or digits > PLAIN_DIGITS or byte != (ord("*") if field == 3 else ord(",")):
                return False
            at += 1
            if field > 0:
                force = value / DECIMAL_POWERS[decimals]
                forces[row, field - 1] = -force if negative else force
            elif negative or fraction:
                return False
            else:
                counts[row] = value % 2**32
        check = 0
        for each in range(first, at - 1):
            check ^= int(block[each])
        told = 0
        for _ in range(2):
            byte = int(block[at])
            if ord("0") <= byte <= ord("9"):
                told = 16 * told + byte - ord("0")
            elif ord("A") <= byte <= ord("F"):
                told = 16 * told + byte - ord("A") + 10
            else:
                return False
            at += 1
        if told != check or block[at] != ord("\n"):
            return False
        at += 1
    return True


@njit(cache=True)
def judge_block(
    counts: IntArray, forces: FloatArray, limits: FloatArray, state: IntArray, wrap: int, ticks: float, slack: float
) -> tuple[int, float]:
    """How far the count went on over samples that may all be kept, and the largest force of them, N.

    -1 and 0.0, and nothing has changed, if one may be none.

    Args:
        counts, forces: (N,) and (N, 3), N.
        limits: (4, 3) largest change of a force from one sample to the next, N; longest run of one value; the force
            before, which becomes that of the last sample; zero of the force, N.
        state: (4,) count of the sample before, and how often each axis had the value that it has; goes on likewise.
        wrap: the count begins anew after so many.
        ticks, slack: by how much a count goes on, and how much that may be off.
    """
    before, advance, strongest = state[0], 0, 0.0
    runs = state[1:].copy()
    for row in range(len(counts)):
        step = (counts[row] - before) % wrap
        if abs(step - ticks) > slack:
            return -1, 0.0
        advance += step
        before = counts[row]
        square = 0.0
        for axis in range(3):
            value = forces[row, axis]
            was = limits[2, axis] if row == 0 else forces[row - 1, axis]
            if not abs(value - was) <= limits[0, axis]:
                return -1, 0.0
            runs[axis] = runs[axis] + 1 if value == was else 1
            if runs[axis] > limits[1, axis]:
                return -1, 0.0
            square += (value - limits[3, axis]) ** 2
        strongest = max(strongest, square)
    state[0] = before
    state[1:] = runs
    limits[2] = forces[-1]
    return advance, strongest**0.5


def load_sample_kernels() -> None:
    """Compile or load the kernels now: the thread that reads a sensor must not wait for that."""
    counts, forces = np.zeros(1, np.int64), np.zeros((1, 3))
    block = np.frombuffer(bytes(16), np.uint8)  # one that cannot be written to is another type
    whole_frames(block, np.frombuffer(bytes(4), np.uint8), 16)
    read_frames(block, 0, np.ones(3), counts, forces)
    read_lines(np.frombuffer(b"\n\n", np.uint8), counts, forces)
    judge_block(counts, forces, np.zeros((4, 3)), np.zeros(4, np.int64), 65536, 1.0, 0.1)
