"""Recovery: the limit that is printed is that at which crests put into the log are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping.arrays import FloatArray
from mapping.base.base import Base
from mapping.base.laid_trace import LaidTrace
from mapping.detection.detect import detect
from mapping.detection.recovery import recovered
from mapping.surface import Surface
from mapping.trace import Trace

TIP, STEP, LENGTH, SWEEPS, WHITE = 10e-3, 20e-6, 0.1, 10, 0.05e-3
S = np.arange(int(LENGTH / STEP)) * STEP
PLATE = Base(Surface([[-0.2, -0.2, 0], [0.2, -0.2, 0], [0.2, 0.2, 0], [-0.2, 0.2, 0]], [[0, 1, 2], [0, 2, 3]]))


def laid(levels: FloatArray, sweeps: int = SWEEPS) -> LaidTrace:
    heights = levels[:sweeps, None] * WHITE * np.random.default_rng(13).standard_normal((sweeps, len(S)))
    y = np.repeat(np.linspace(-0.04, 0.04, sweeps), len(S))
    centers = np.column_stack([np.tile(S - 0.5 * LENGTH, sweeps), y, TIP + heights.ravel()])
    return LaidTrace.of(Trace(np.arange(len(y)) * 2e-4, centers, np.repeat(np.arange(sweeps), len(S)), TIP), PLATE)


def test_in_white_noise_the_computed_limit_is_the_measured_one() -> None:
    trace = laid(np.ones(SWEEPS))
    computed = detect(trace, PLATE)
    measured = recovered(computed, trace, np.random.default_rng(0))
    assert measured.injected >= 20
    assert measured.recovered >= 0.85 * measured.injected
    assert measured.detection_limit <= 1.13 * computed.detection_limit


def test_where_the_level_differs_by_sweep_the_computed_limit_is_that_of_a_place_by_chance() -> None:
    levels = np.exp(0.7 * np.random.default_rng(14).standard_normal(SWEEPS))
    trace, even = laid(levels), laid(np.full(SWEEPS, np.median(levels)))
    computed = detect(trace, PLATE)
    assert computed.detection_limit > 1.3 * detect(even, PLATE).detection_limit
    measured = recovered(computed, trace, np.random.default_rng(0))
    assert measured.recovered >= 0.85 * measured.injected
    assert measured.detection_limit <= 1.13 * computed.detection_limit


def test_a_limit_that_is_too_low_is_raised_and_that_is_told() -> None:
    trace = laid(np.exp(0.7 * np.random.default_rng(14).standard_normal(SWEEPS)))
    computed = detect(trace, PLATE)
    low = replace(computed, detection_limit=0.5 * computed.detection_limit)
    measured = recovered(low, trace, np.random.default_rng(0))
    assert measured.detection_limit > 1.3 * low.detection_limit
    assert measured.recovered >= 0.85 * measured.injected
    assert "limit was raised" in measured.remarks[-1]


def test_too_short_a_log_says_that_nothing_was_measured() -> None:
    trace = laid(np.ones(SWEEPS), sweeps=1)
    measured = recovered(detect(trace, PLATE), trace, np.random.default_rng(0))
    assert measured.injected == 0
    assert "computed, not measured" in measured.left_out[-1]


def test_a_sweep_too_short_to_be_looked_at_puts_the_limit_in_no_doubt() -> None:
    trace = laid(np.ones(SWEEPS))
    short = trace.select(np.flatnonzero((trace.sweep < SWEEPS - 1) | (np.arange(len(trace)) % len(S) < 7)))
    computed = detect(short, PLATE)
    assert len(computed.left_out) == 1 and not computed.limit_in_doubt
    assert replace(computed, remarks=("the noise is not the same everywhere",)).limit_in_doubt
    assert replace(computed, left_out=(*computed.left_out, "9 samples were not felt and are left out")).limit_in_doubt


def test_crossings_that_are_asked_about_are_those_of_all_that_lie_there() -> None:
    trace = laid(np.ones(SWEEPS))
    lift = sum(
        np.maximum(height - (trace.laid_sweeps[0].arclength - place) ** 2 / (2 * TIP), 0.0)
        for place, height in ((0.02, 1e-3), (0.035, 0.3e-3), (0.07, 0.5e-3))
    )
    centers = trace.centers + np.tile(lift, SWEEPS)[:, None] * [0.0, 0.0, 1.0]
    bumpy = Trace(trace.t, centers, trace.sweep, TIP)
    every = {(c.sweep, c.start, c.stop, c.height, c.snr) for c in detect(bumpy, PLATE).crossings}
    about = {sweep: np.array([[0.069, 0.071]]) for sweep in range(1, SWEEPS)}
    there = {(c.sweep, c.start, c.stop, c.height, c.snr) for c in detect(bumpy, PLATE, about=about).crossings}
    assert there < every
    assert {sweep for sweep, *_ in there} == set(about) and len(every) == 3 * SWEEPS
