"""Logs whose every value follows from the sample's number, so that nothing lost or misplaced goes unseen."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from explore3d.log.own.writer import LogWriter
from hw.move import Move
from mapping.trace import Trace

RADIUS = 0.01
MOVE = Move([[0.0, 0.1, 0.2], [1.0 / 3.0, 0.0, 0.0]], [0.3, 0.1, -1.0], speed=0.03, force=1.0)


def trace_of(first: int, count: int, sweep: int = 0, **optional: np.ndarray) -> Trace:
    """Samples first, first + 1, ...: every value follows from the sample's number alone."""
    number = np.arange(first, first + count, dtype=np.float64)
    centers = np.column_stack([np.sin(number), np.cos(number) * 1e-7, number / 3.0])
    return Trace(number / 5000.0, centers, np.full(count, sweep), RADIUS, **optional)


def write_log(path: Path, moves: int = 12, count: int = 700) -> Path:
    """A log of several chunks: some moves give no samples, and there are events between them."""
    with LogWriter(path, tip_radius=RADIUS, scene_text="seed = 1\n", metadata={"seed": 1}) as log:
        for number in range(moves):
            log.write(MOVE, trace_of(number * count, count, number))
            log.write(Move([[0, 0, 1]], [0, 0, -1], purpose="travel"), trace_of(0, 0))
            log.event("detection", {"number": number, "at": np.array([1.0, 2.0])})
    return path


def assert_same_samples(trace: Trace, numbers: np.ndarray) -> None:
    truth = trace_of(0, int(numbers.max()) + 1).select(numbers)
    assert np.array_equal(trace.t, truth.t)
    assert np.array_equal(trace.centers, truth.centers)


def numbers_of(trace: Trace) -> np.ndarray:
    return np.rint(trace.t * 5000.0).astype(int)
