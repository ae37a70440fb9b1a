"""Lengths: do the 90 % intervals of lines' lengths hold the truth, however their ends are made?

Sweeps across a line on a plate feel its ends as they pass beside them. The traces are dilations in closed form of their
own: of bodies whose every point over the plate depends on its distance from a rectangle or a segment in plan.

    explore3d bench lengths --seeds 10
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from explore3d.analysis import Stages, build_model
from explore3d.bench.scenes import plate
from explore3d.log import Log
from hw.simulated import NoiseSource
from mapping import FloatArray, Trace

# Ball, distance between samples, and half of a sweep, m
LENGTHS_TIP, LENGTHS_STEP, LENGTHS_HALF = 10e-3, 60e-6, 22e-3
# Levels of noise of every coordinate of a sample, in turn, m; and of it the correlated part and over what length, m
LENGTHS_LEVELS = (0.02e-3, 0.06e-3)
LENGTHS_NOISES = {"white": 0.0, "OU": 0.1}
CORRELATED_WITHIN = 1e-3


@dataclass(frozen=True)
class EndedLine:
    """A straight line over the plate: what it is, its sizes and its length between ends, m."""

    kind: str
    height: float
    width: float
    length: float


# Heights of the ball over the plate at places s along a line and d across it, m
Felt = Callable[[EndedLine, FloatArray, FloatArray], FloatArray]


def _round_wire(line: EndedLine, s: FloatArray, d: FloatArray) -> FloatArray:
    """A wire with half balls beyond both ends of its crest."""
    a = 0.5 * line.height
    return _over(np.hypot(_beyond(s, 0.5 * line.length), d), a, LENGTHS_TIP + a)


def _square_wire(line: EndedLine, s: FloatArray, d: FloatArray) -> FloatArray:
    """A wire that is cut across: beyond an end the ball meets its rim, a circle."""
    a, out = 0.5 * line.height, _beyond(s, 0.5 * line.length)
    within = out < LENGTHS_TIP
    return np.where(within, _over(d, a, a + np.sqrt(np.where(within, LENGTHS_TIP**2 - out**2, 1.0))), 0.0)


def _square_bar(line: EndedLine, s: FloatArray, d: FloatArray) -> FloatArray:
    """A bar with upright walls and square corners."""
    out = np.hypot(_beyond(s, 0.5 * line.length), _beyond(d, 0.5 * line.width))
    return _over(out, line.height, LENGTHS_TIP)


def _stadium_bar(line: EndedLine, s: FloatArray, d: FloatArray) -> FloatArray:
    """The same with half discs for ends."""
    out = np.hypot(_beyond(s, 0.5 * (line.length - line.width)), d) - 0.5 * line.width
    return _over(np.maximum(out, 0.0), line.height, LENGTHS_TIP)


def _square_slot(line: EndedLine, s: FloatArray, d: FloatArray) -> FloatArray:
    """A groove with upright walls and square corners: the ball hangs on the nearest rim, or stands on the bottom."""
    return _within(line, np.minimum(0.5 * line.length - np.abs(s), 0.5 * line.width - np.abs(d)))


def _milled_slot(line: EndedLine, s: FloatArray, d: FloatArray) -> FloatArray:
    """The same as a cutter of its width leaves it."""
    return _within(line, 0.5 * line.width - np.hypot(_beyond(s, 0.5 * (line.length - line.width)), d))


def _beyond(x: FloatArray, half: float) -> FloatArray:
    return np.maximum(np.abs(x) - half, 0.0)


def _over(away: FloatArray, level: float, radius: float | FloatArray) -> FloatArray:
    """Of a ball whose centre is `radius` from a point `level` above the plate, `away` aside of it."""
    return np.maximum(level - LENGTHS_TIP + np.sqrt(np.maximum(np.square(radius) - away**2, 0.0)), 0.0)


def _within(line: EndedLine, inside: FloatArray) -> FloatArray:
    reach = np.clip(inside, 0.0, LENGTHS_TIP)
    return np.maximum(np.sqrt(LENGTHS_TIP**2 - reach**2) - LENGTHS_TIP, line.height)


LENGTHS_FORMS: dict[str, tuple[str, Felt]] = {
    "square wire": ("ridge", _square_wire),
    "round wire": ("ridge", _round_wire),
    "square bar": ("ridge", _square_bar),
    "stadium bar": ("ridge", _stadium_bar),
    "square slot": ("groove", _square_slot),
    "milled slot": ("groove", _milled_slot),
}


def bench_lengths(forms: Sequence[str], noises: Sequence[str], seeds: range) -> Iterator[str]:
    """CSV lines: of each form and noise the trials, those with one line of its kind, and lengths within 90 %."""
    yield "form,noise,trials,right,lengths,lengths_inside,bias_sds,scatter_sds"
    for form in forms:
        for noise in noises:
            inside, off = list[bool](), list[float]()
            for seed in seeds:
                line, lengths = lengths_trial(form, noise, seed)
                if lengths is not None:
                    low, median, high = lengths
                    inside.append(low <= line.length <= high)
                    off.append((median - line.length) / ((high - low) / 3.29))
            counts = f"{len(seeds)},{len(inside)},{len(inside)},{sum(inside)}"
            yield (
                f"{form},{noise},{counts},{np.mean(off):.2f},{np.std(off):.2f}" if off else f"{form},{noise},{counts},,"
            )


def lengths_trial(form: str, noise: str, seed: int) -> tuple[EndedLine, tuple[float, float, float] | None]:
    """What one line is, and low, median and high of its length, m; None where it was not found alone."""
    line, trace = lengths_trace(form, noise, seed)
    analysis = build_model(Log(trace), None, plate(), Stages(quick=True))
    if [feature.kind for feature in analysis.model.features] != [line.kind]:
        return line, None
    length = analysis.model.features[0].length
    return line, (length.low, length.median, np.inf if length.censored else length.high)


def lengths_trace(form: str, noise: str, seed: int) -> tuple[EndedLine, Trace]:
    """A line of any sizes at any slant below sweeps 2 to 5 mm apart, of which 2 to 12 cross it."""
    kind, felt = LENGTHS_FORMS[form]
    rng = np.random.default_rng((seed, list(LENGTHS_FORMS).index(form), 19))
    count, pitch, slant = 3 + seed % 10, float(rng.uniform(2e-3, 5e-3)), float(rng.uniform(-0.5, 0.5))
    pitch = min(pitch, 55e-3 / (count + 1))
    length = pitch * (count - 1 + float(rng.uniform(0.1, 0.9))) / np.cos(slant)
    if "slot" not in form:
        height, width = float(rng.uniform(0.3e-3, 0.7e-3)), float(np.exp(rng.uniform(np.log(0.3e-3), np.log(3e-3))))
    else:
        height, width = -float(rng.uniform(0.05e-3, 0.3e-3)), float(rng.uniform(2e-3, 4e-3))
    line = EndedLine(kind, height, height if "wire" in form else width, length)
    middle, way = rng.uniform(-2e-3, 2e-3, 2), np.array([np.cos(slant), np.sin(slant)])
    level = LENGTHS_LEVELS[seed // 10 % 2]
    source = NoiseSource(white=level, correlated=LENGTHS_NOISES[noise] * level, correlation_length=CORRELATED_WITHIN)
    along, parts = np.arange(-LENGTHS_HALF, LENGTHS_HALF, LENGTHS_STEP), list[FloatArray]()
    for number, x in enumerate(np.arange(-38e-3 + rng.uniform(0.0, pitch), 38e-3, pitch)):
        flat = np.column_stack([np.full(len(along), x), along[:: -1 if number % 2 else 1]]) - middle
        height_felt = felt(line, flat @ way, flat @ np.array([-way[1], way[0]]))
        centers = np.column_stack([flat + middle, LENGTHS_TIP + height_felt])
        parts.append(centers + source.of_centers(rng, len(centers), LENGTHS_STEP))
    sweep = np.repeat(np.arange(len(parts)), len(along))
    return line, Trace(2e-3 * np.arange(float(len(sweep))), np.concatenate(parts), sweep, LENGTHS_TIP)
