"""LaMotte's task: which of two strokes went over something? Asked of the detector, beside what people answer.

R. H. LaMotte and J. Whitehouse, Tactile detection of a dot on a smooth surface, J. Neurophysiology 56, 1986; R. S.
Johansson and R. H. LaMotte, Tactile detection thresholds for a single asperity on an otherwise smooth surface,
Somatosensory Research 1, 1983: three answers of four are right at the heights in `HUMAN_HEIGHTS`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hw.simulated import NoiseSource
from mapping import FloatArray, Surface, Trace, detect
from mapping.base import Base
from mapping.geometry.templates import step_height
from mapping.instrument import Noise

# Diameter of an etched dot, m (0: an edge), and the height that people feel in three strokes of four, m
HUMAN_HEIGHTS = {"edge": (0.0, 0.85e-6), "dot 602 um": (602e-6, 1.09e-6), "dot 231 um": (231e-6, 2.94e-6),
                 "dot 40 um": (40e-6, 5.97e-6)}  # fmt: skip
# Heights that are asked for, in those of people
HEIGHT_SHARES = (0.1, 1.0 / 3.0, 1.0)
# Noise of a scanning head that is known to 1.3 um: from sample to sample, or correlated along the path, m
HEAD_NOISE = {
    "white": NoiseSource(white=1.3e-6),
    "correlated": NoiseSource(white=0.13e-6, correlated=1.3e-6, correlation_length=1e-3),
}
# The stroke: tip and half length, m; the spacing of 5 kHz at the 10 mm/s of the experiment
STROKE_TIP, STROKE_REACH, STROKE_SPACING = 5e-3, 5e-3, 2e-6
# A guess is wanted for every stroke, so the detector is asked for its best, however faint: false alarms per metre
FORCED_CHOICE = 300.0


@dataclass(frozen=True)
class Answer:
    """How often the right stroke was named: stimulus, kind of noise, height (m), its share of people's, share right."""

    stimulus: str
    noise: str
    height: float
    share: float
    right: float
    trials: int


def bench_touch(trials: int, seed: int = 0) -> Iterator[Answer]:
    """Each stimulus, noise and height, so many times.

    Args:
        trials: pairs of strokes.
        seed: of the noise.
    """
    for stimulus, (diameter, human) in HUMAN_HEIGHTS.items():
        for name, noise in HEAD_NOISE.items():
            for share in HEIGHT_SHARES:
                rng = np.random.default_rng((seed, len(stimulus), len(name), round(1e3 * share)))
                height = share * human
                right = 0.0
                for _ in range(trials):
                    felt, empty = (_strongest(diameter, each, noise, rng) for each in (height, 0.0))
                    right += 0.5 if felt == empty else float(felt > empty)
                yield Answer(stimulus, name, height, share, right / trials, trials)


def touch_lines(answers: list[Answer]) -> list[str]:
    """The psychometric table, in Markdown."""
    head = "| stimulus | people, 75 % right | noise | " + " | ".join(f"{share:.2g} of it" for share in HEIGHT_SHARES)
    lines = [head + " |", "|---|---|---|" + "---|" * len(HEIGHT_SHARES)]
    for stimulus, (_, human) in HUMAN_HEIGHTS.items():
        for name in HEAD_NOISE:
            mine = [each for each in answers if each.stimulus == stimulus and each.noise == name]
            rates = " | ".join(f"{100.0 * each.right:.0f} %" for each in mine)
            lines.append(f"| {stimulus} | {1e6 * human:.2f} um | {name} | {rates} |")
    return lines


def _strongest(diameter: float, height: float, noise: NoiseSource, rng: np.random.Generator) -> float:
    """Signal-to-noise ratio of the strongest crossing of a stroke; 0 if there is none."""
    x = np.arange(-STROKE_REACH, STROKE_REACH, STROKE_SPACING)
    inside = x if diameter == 0.0 else 0.5 * diameter - np.abs(x)
    level = step_height(inside, height, STROKE_TIP) if height > 0.0 else np.zeros_like(x)
    centers = np.column_stack([x, np.zeros_like(x), STROKE_TIP + level])
    centers += noise.of_centers(rng, len(x), STROKE_SPACING)
    trace = Trace(2e-4 * np.arange(float(len(x))), centers, np.zeros(len(x), dtype=np.int64), STROKE_TIP)
    known = Noise(noise.white, noise.correlated, noise.correlation_length)
    found = detect(trace, _plate(), noise=known, false_alarms_per_metre=FORCED_CHOICE)
    return max((abs(each.snr) for each in found.crossings), default=0.0)


def _plate() -> Base:
    corners: FloatArray = 0.02 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Base(Surface(corners, [[0, 1, 2], [0, 2, 3]]))
