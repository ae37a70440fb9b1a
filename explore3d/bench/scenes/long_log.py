"""Long synthetic recordings for the scaling bench: sweeps over a plate with wires on it, written as a log.

The plate grows with the recording, as a larger object would; the heights are closed forms
(mapping.geometry.templates) and the noise is that of the paper's apparatus.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from explore3d.log import KIND, LogWriter, base_event
from hw import Move
from mapping import FloatArray, Surface, Trace
from mapping.base import Base
from mapping.geometry.templates import chain_height

TIP_RADIUS = 10e-3
WIRE_RADIUS = 0.325e-3  # of the wires
SAMPLE_RATE, SPEED = 5000.0, 0.03
PITCH = 4e-3  # between sweeps
WHITE_NOISE, CORRELATED_NOISE, CORRELATION_LENGTH = 0.2e-3, 0.02e-3, 1e-3
LONGEST_SWEEP, FEWEST_SWEEPS = 15_000, 20
UP = np.array([0.0, 0.0, 1.0])


def write_long_log(
    path: Path | str, samples: int, wires: int = 4, seed: int = 1, share: Callable[[float], None] = lambda _: None
) -> tuple[FloatArray, ...]:
    """Write a log of about so many samples; returns the wires' axes, each (2, 3), m."""
    length = min(LONGEST_SWEEP, max(samples // FEWEST_SWEEPS, 2))
    count = -(-samples // length)
    plate = _plate(count * PITCH, length * SPEED / SAMPLE_RATE)
    axes = wire_axes(wires, count * PITCH, length * SPEED / SAMPLE_RATE)
    with LogWriter(path, tip_radius=TIP_RADIUS, metadata={"software": "explore3d bench", "seed": seed}) as log:
        log.event(KIND, base_event(plate))
        for number, (move, trace) in enumerate(_sweeps(count, length, axes, np.random.default_rng(seed))):
            log.write(move, trace)
            share((number + 1) / count)
    return axes


def wire_axes(count: int, width: float, height: float) -> tuple[FloatArray, ...]:
    """So many wires across the sweeps of a plate, far enough from each other not to touch the same ball."""
    if count == 0:
        return ()
    rows = max(1, round(np.sqrt(count * height / width)))
    columns = -(-count // rows)
    cell = np.array([width / columns, height / rows])
    half = min(0.03, 0.5 * cell[0] - 6e-3)
    slope = min(0.3, (0.5 * cell[1] - 6e-3) / half) if cell[1] > 12e-3 else 0.0
    slots = [((k // rows + 0.5) * cell[0], (k % rows + 0.5) * cell[1]) for k in range(count)]
    along = half * np.array([1.0, slope, 0.0])
    return tuple(
        np.array([np.array([x, y, WIRE_RADIUS]) - along, np.array([x, y, WIRE_RADIUS]) + along]) for x, y in slots
    )


def _plate(width: float, height: float) -> Base:
    margin = 5e-3
    low, high = (-margin, -margin), (width + margin, height + margin)
    corners = [[low[0], low[1], 0.0], [high[0], low[1], 0.0], [high[0], high[1], 0.0], [low[0], high[1], 0.0]]
    return Base(Surface(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]])))


def _sweeps(
    count: int, length: int, axes: tuple[FloatArray, ...], rng: np.random.Generator
) -> Iterator[tuple[Move, Trace]]:
    from scipy.signal import lfilter

    step = SPEED / SAMPLE_RATE
    keep = np.exp(-step / CORRELATION_LENGTH)
    y = step * np.arange(length)
    for number in range(count):
        x = (number + 0.5) * PITCH
        feet = np.column_stack([np.full(length, x), y if number % 2 == 0 else y[::-1], np.zeros(length)])
        height = np.zeros(length)
        for axis in axes:
            if axis[:, 0].min() - TIP_RADIUS < x < axis[:, 0].max() + TIP_RADIUS:
                height = np.maximum(height, chain_height(feet, np.tile(UP, (length, 1)), axis, WIRE_RADIUS, TIP_RADIUS))
        kicks = np.sqrt(1.0 - keep**2) * rng.standard_normal(length)
        kicks[0] = rng.standard_normal()
        noise = WHITE_NOISE * rng.standard_normal(length) + CORRELATED_NOISE * lfilter([1.0], [1.0, -keep], kicks)
        centers = feet + (TIP_RADIUS + height + noise)[:, None] * UP
        t = (number * length + np.arange(length)) / SAMPLE_RATE
        move = Move(path=feet[[0, -1]] + TIP_RADIUS * UP, approach=-UP, speed=SPEED)
        yield move, Trace(t, centers, np.full(length, number), TIP_RADIUS)
