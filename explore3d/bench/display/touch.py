"""LaMotte's task: which of two strokes went over something? Asked of the detector, beside what people answer.

R. S. Johansson and R. H. LaMotte, Tactile detection thresholds for a single asperity on an otherwise smooth surface,
Somatosensory Research 1, 1983 (and R. H. LaMotte and J. Whitehouse, Tactile detection of a dot on a smooth surface, J.
Neurophysiology 56, 1986): at the heights in `HUMAN_HEIGHTS` d' is 1.35 in people who stroke two wafers as they like and
name the one that something is on, so that Phi(1.35 / sqrt 2) = 83 % of their answers are right.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from explore3d.bench.display.ideal_observer import OBSERVED_LENGTH, best_shares
from hw.simulated import NoiseSource
from mapping import FloatArray, Surface, Trace, detect
from mapping.base import Base
from mapping.geometry.templates import step_height
from mapping.instrument import Noise

# Diameter of an etched dot, m (0: an edge), and the height at which people name the right one in 83 %, m
HUMAN_HEIGHTS = {"edge": (0.0, 0.85e-6), "dot 602 um": (602e-6, 1.09e-6), "dot 231 um": (231e-6, 2.94e-6),
                 "dot 40 um": (40e-6, 5.97e-6)}  # fmt: skip
# Heights that are asked for, in those of people
HEIGHT_SHARES = (0.1, 1.0 / 3.0, 1.0)
# What a scanning head is known to, m. What makers state of one is its scanning probing error, by ISO 10360-4 the range
# (largest less smallest) of all radii along four lines on a sphere of 25 mm
HEAD_ERROR = 1.3e-6
# That range in standard deviations of the noise: 6.7 +- 0.6 for noise correlated over 1 mm on 0.2 m of lines, 7.5 over
# 0.3 mm, 5.9 over 3 mm (simulated, 400 heads of each, 50 samples in a correlation length)
RANGE_DEVIATIONS = 6.7
# A machine that scans at 10 mm/s swings below 5 Hz with its body, at 20 to 30 Hz with its probe: its noise is
# correlated over v / (2 pi f), 0.3 mm and more of the one, 0.06 mm of the other, m
HEAD_CORRELATION = 1e-3
# Of correlated noise so much is white: the head's own resolution, not the machine's swinging
WHITE_SHARE = 0.1
# Noise of a head: standard deviation of 1.3 um from sample to sample, the same correlated, and a range of 1.3 um
HEAD_NOISES = ("white", "correlated", "range")
# The stroke: tip and half length, m; the spacing of 5 kHz at the 10 mm/s of the experiment
STROKE_TIP, STROKE_REACH, STROKE_SPACING = 5e-3, 5e-3, 2e-6
# A guess is wanted for every stroke, so the detector is asked for its best, however faint: false alarms per metre
FORCED_CHOICE = 300.0
# Where something may be on the stroke, m to either side, and how far apart the ideal observer looks: a third of what
# the ball takes to climb the lowest edge
PLACES_REACH, PLACES_STEP = 4e-3, 20e-6


@dataclass(frozen=True)
class Answer:
    """How often the right stroke was named.

    Args:
        stimulus: one of HUMAN_HEIGHTS; noise: one of HEAD_NOISES.
        height: m; share: of the height that people feel.
        right: share of the detector's answers; trials: pairs of strokes it was asked.
        place_known, place_unknown: shares that the ideal observer names rightly: nobody is right more often.
    """

    stimulus: str
    noise: str
    height: float
    share: float
    right: float
    trials: int
    place_known: float
    place_unknown: float


def head_noise(name: str, correlation_length: float = HEAD_CORRELATION) -> NoiseSource:
    """One of HEAD_NOISES, correlated over a length, m."""
    if name == "white":
        return NoiseSource(white=HEAD_ERROR)
    level = HEAD_ERROR if name == "correlated" else HEAD_ERROR / RANGE_DEVIATIONS
    return NoiseSource(white=WHITE_SHARE * level, correlated=level, correlation_length=correlation_length)


def bench_touch(
    trials: int, seed: int = 0, correlation_length: float = HEAD_CORRELATION, noises: Sequence[str] = HEAD_NOISES
) -> Iterator[Answer]:
    """Each stimulus, noise and height, so many times.

    Args:
        trials: pairs of strokes.
        seed: of the noise.
        correlation_length: of the correlated noise, m.
        noises: of HEAD_NOISES.
    """
    for stimulus, (diameter, human) in HUMAN_HEIGHTS.items():
        for name in noises:
            noise = head_noise(name, correlation_length)
            for share in HEIGHT_SHARES:
                rng = np.random.default_rng((seed, len(stimulus), len(name), round(1e3 * share)))
                height = share * human
                right = 0.0
                for _ in range(trials):
                    felt, empty = (_strongest(diameter, each, noise, rng) for each in (height, 0.0))
                    right += 0.5 if felt == empty else float(felt > empty)
                known, unknown = best_shares(_everywhere(diameter, height), noise, OBSERVED_LENGTH, STROKE_SPACING, rng)
                yield Answer(stimulus, name, height, share, right / trials, trials, known, unknown)


def touch_lines(answers: list[Answer]) -> list[str]:
    """The psychometric table, in Markdown: the detector's share, and in brackets the ideal observer's two."""
    head = "| stimulus | people, 83 % right | noise | " + " | ".join(f"{share:.2g} of it" for share in HEIGHT_SHARES)
    lines = [head + " |", "|---|---|---|" + "---|" * len(HEIGHT_SHARES)]
    for stimulus, (_, human) in HUMAN_HEIGHTS.items():
        for name in dict.fromkeys(each.noise for each in answers):
            mine = [each for each in answers if each.stimulus == stimulus and each.noise == name]
            rates = " | ".join(
                f"{100.0 * each.right:.0f} % ({100.0 * each.place_unknown:.0f}, {100.0 * each.place_known:.0f})"
                for each in mine
            )
            lines.append(f"| {stimulus} | {1e6 * human:.2f} um | {name} | {rates} |")
    return lines


def _everywhere(diameter: float, height: float) -> FloatArray:
    """(M, N) heights of a stroke over something at each of its places, m, averaged over OBSERVED_LENGTH."""
    x = np.arange(-STROKE_REACH, STROKE_REACH, OBSERVED_LENGTH) + 0.5 * OBSERVED_LENGTH
    off = x - np.arange(-PLACES_REACH, PLACES_REACH + PLACES_STEP, PLACES_STEP)[:, None]
    return np.asarray(_climbed(off, diameter, height))


def _climbed(x: FloatArray, diameter: float, height: float) -> FloatArray:
    """Heights of the ball over an edge, or a dot across its middle, at 0, m."""
    return step_height(x if diameter == 0.0 else 0.5 * diameter - np.abs(x), height, STROKE_TIP)


def _strongest(diameter: float, height: float, noise: NoiseSource, rng: np.random.Generator) -> float:
    """Signal-to-noise ratio of the strongest crossing of a stroke; 0 if there is none."""
    x = np.arange(-STROKE_REACH, STROKE_REACH, STROKE_SPACING)
    level = _climbed(x, diameter, height) if height > 0.0 else np.zeros_like(x)
    centers = np.column_stack([x, np.zeros_like(x), STROKE_TIP + level])
    centers += noise.of_centers(rng, len(x), STROKE_SPACING)
    trace = Trace(2e-4 * np.arange(float(len(x))), centers, np.zeros(len(x), dtype=np.int64), STROKE_TIP)
    known = Noise(noise.white, noise.correlated, noise.correlation_length)
    found = detect(trace, _plate(), noise=known, false_alarms_per_metre=FORCED_CHOICE)
    return max((abs(each.snr) for each in found.crossings), default=0.0)


def _plate() -> Base:
    corners: FloatArray = 0.02 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
