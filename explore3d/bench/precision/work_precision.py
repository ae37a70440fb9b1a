"""Work and precision: what an error costs in time, one point for each setting of each method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import perf_counter
from typing import TypeVar

Value = TypeVar("Value")

LONG_ENOUGH = 1.0  # s; a call that takes longer is not repeated


@dataclass(frozen=True)
class Point:
    """One setting of one method.

    Args:
        stage: name of the stage.
        method: one curve of the diagram.
        setting: what was turned, in words.
        seconds: wall time, the median of the repeats; compiling and importing not counted.
        error: achieved, against the stage's reference, in the stage's unit.
        repeats: calls that were timed.
        finger: seconds of the finger, where one moves; else 0.
    """

    stage: str
    method: str
    setting: str
    seconds: float
    error: float
    repeats: int = 1
    finger: float = 0.0


@dataclass(frozen=True)
class LeftOutMethod:
    """What a diagram does not show, and why."""

    stage: str
    method: str
    reason: str


@dataclass(frozen=True)
class Stage:
    """A stage that trades time for error.

    Args:
        name: short, also of its picture's file.
        error: what the error is, and its unit.
        reference: what it is measured against, and how the reference was checked.
        look: what to look at in the diagram.
        measure: runs it: (quick, peers) to what came out.
    """

    name: str
    error: str
    reference: str
    look: str
    measure: Callable[[bool, bool], list[Point | LeftOutMethod]]


def timed(work: Callable[[], Value], repeats: int = 3) -> tuple[float, int, Value]:
    """Median wall time, how many calls it is of, and the last call's value; the first call is not counted.

    The uncounted first call pays for compiling; where it takes more than a second, it is the only one.
    """
    begin = perf_counter()
    value = work()
    first = perf_counter() - begin
    if first > LONG_ENOUGH * 5:
        return first, 1, value
    seconds = []
    for _ in range(repeats):
        begin = perf_counter()
        value = work()
        seconds.append(perf_counter() - begin)
        if seconds[-1] > LONG_ENOUGH:
            break
    return median(seconds), len(seconds), value


@dataclass(frozen=True)
class Measured:
    """A stage and what came of it; `seconds` is what measuring it took."""

    stage: Stage
    points: tuple[Point, ...]
    omissions: tuple[LeftOutMethod, ...]
    seconds: float
