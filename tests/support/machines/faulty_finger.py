"""A finger on which things go wrong on purpose, at chosen moves."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from hw.errors import FingerError
from hw.move import Move
from mapping.trace import Trace

FAULTS = ("loses contact", "cut short", "no data", "nan readings", "some nan", "refuses", "shifted")


def faulty(execute: Callable[[Move], Trace], at: Collection[int], fault: str) -> Callable[[Move], Trace]:
    """`execute`, with a fault in the moves of these numbers (from 0); "gone" is for good from the first of them on."""
    count = -1

    def broken(move: Move) -> Trace:
        nonlocal count
        count += 1
        gone = fault == "gone" and at and count >= min(at)
        if count not in at and not gone:
            return execute(move)
        if gone or fault == "refuses":
            raise FingerError("the finger is stuck")
        trace = execute(move)
        return spoiled(trace, fault)

    return broken


def spoiled(trace: Trace, fault: str) -> Trace:
    """What is left of a trace after a fault."""
    count = len(trace)
    if fault == "no data":
        return trace.select(slice(0, 0))
    if fault == "cut short":
        return trace.select(slice(0, count // 3))
    if fault == "loses contact":
        return trace.select(np.r_[0 : count // 4, 3 * count // 4 : count])
    if fault == "shifted":  # the object was pushed by a millimetre
        return replace(trace, centers=trace.centers + np.array([0.0, 0.0, 1e-3]))
    centers = trace.centers.copy()
    centers[(slice(None) if fault == "nan readings" else slice(count // 3, count // 2))] = np.nan
    return Trace.of_readings(trace.t, centers, trace.sweep, trace.tip_radius)
