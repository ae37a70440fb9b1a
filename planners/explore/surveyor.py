"""Surveyor: carries the survey out, as closely as its first sweep asks for, and looks at what every sweep felt."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hw import Move
from mapping import FloatArray, Trace, length_text
from mapping.base import LaidTrace
from mapping.detection import Coverage, detect
from mapping.estimate.deviation import Deviation, explain
from mapping.instrument import Noise, StatedNoise
from planners import Outcome, Plan, executed
from planners.explore.found import Found
from planners.survey import Survey

# Path of the first survey sweeps, in tip radii, that tell the noise if it is not given; later ones are detected singly
FIRST_NOISE_PATH = 50.0
# False alarms of the survey against those accepted in the end: a look at each of them costs seconds, and what the
# analysis of all sweeps may report at its own estimate of the noise must have been looked at
CANDIDATES = 4.0
# What the analysis may report, in accepted false alarms: what is 3 % below its threshold of some 4.7 by this estimate
# of the noise may be above it by its own (which scattered by 1.6 % in 12 explored logs); by theory equation 6.12 that
# is exp(0.03 * 4.7^2) = 1.9 times as much
REPORTABLE = 2.0
# Height that must stay visible between two sweeps, in detection limits; and its least share of the smallest feature's
VISIBLE_HEIGHT_MARGIN, LEAST_VISIBLE_SHARE = 1.25, 0.1
# Lines that are worked out before each sweep: one takes some 13 ms on the bench's bodies, and the finger is to wait no
# longer than 50 ms; all are after a third of the sweeps
LAID_OUT = 3
# Samples that a sweep must have to be looked at
FEWEST_SWEEP_SAMPLES = 16


@dataclass
class SurveyCount:
    """How far a survey is, for whoever watches it.

    Args:
        planned: sweeps that it wants, known once the first has told the noise; None before. A line is one, until it is
            known whether ball and stem can make it whole: it changes in the first third where they cannot.
        made: sweeps that it was answered, also those that could not be made.
    """

    planned: int | None = None
    made: int = 0


@dataclass
class Surveyor:
    """One survey under way.

    Args:
        survey: what to sweep.
        found: where crossings and noise are noted.
        false_alarms_per_metre: accepted rate of false crossings in the end, 1/m.
        stated: what is known of the noise before; None: nothing.
        given_noise: that was known before the survey; None: none.
        visible: share of the smallest feature's height that stays visible between two sweeps.
        paths: touched by the sweeps so far, each (K, 3), m.
        felt: by each sweep that felt anything.
        commanded: paths of the ball's centre (K, 3) that were carried out, m.
        limit: least height that the sweeps detect one by one, m.
        count: kept up as it goes.
    """

    survey: Survey
    found: Found
    false_alarms_per_metre: float
    stated: StatedNoise | None = None
    count: SurveyCount = field(default_factory=SurveyCount)
    visible: float = field(init=False)
    given_noise: Noise | None = field(init=False)
    paths: list[FloatArray] = field(init=False, default_factory=list)
    felt: list[Trace] = field(init=False, default_factory=list)
    commanded: list[FloatArray] = field(init=False, default_factory=list)
    limit: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        self.visible = self.survey.visible
        self.given_noise = self.found.noise

    def plan(self) -> Plan:
        """Every sweep of the survey; the first ones are detected together, for they tell the noise."""
        strips = self.survey.crossed(self.survey.visible) is None
        if strips and (first := next(self.survey.sweeps(), None)) is not None:
            trace = yield first
            self.count.made += 1
            self._keep(executed(first, trace), trace)
            self._widen(trace)
        waiting, felt = list[Trace](), 0.0
        for move in self._laid_out():
            trace = yield move
            self.count.made += 1
            done = executed(move, trace)
            self.paths.extend(self.survey.touched(part) for part in done)
            self._keep(done, trace)
            if not done:
                self.found.left_out.append("a survey sweep was not carried out")
                continue
            if len(trace) == 0:
                self.found.left_out.append("a survey sweep felt no contact")
                continue
            waiting.append(trace)
            felt += sum(part.length for part in done)
            if self.found.noise is not None or felt >= FIRST_NOISE_PATH * self.survey.tip_radius:
                self._detect(waiting)
        if waiting:
            self._detect(waiting)
        return Outcome("done")

    def _laid_out(self) -> Iterator[Move]:
        """The sweeps; what ball and stem can make of a few lines is worked out before each, not of all at once."""
        lines, ahead = deque(self.survey.lines(self.visible)), deque[Move]()
        while True:
            for _ in range(min(LAID_OUT, len(lines))):
                ahead.extend(self.survey.pressed(lines.popleft()))
            self.count.planned = self.count.made + len(ahead) + len(lines)
            if ahead:
                yield ahead.popleft()
            elif not lines:
                return

    def _keep(self, done: Sequence[Move], trace: Trace) -> None:
        self.commanded.extend(part.path for part in done)
        self.felt.extend([trace] if len(trace) else [])

    def deviation(self) -> Deviation | None:
        """What all that was felt shows to be wrong with the model, None if nothing."""
        base = self.survey.base
        return explain(Trace.concatenate(self.felt), base, self.commanded) if self.felt else None

    def look_again(self, deviation: Deviation) -> None:
        """What was found on a wrong model is forgotten, and looked for on the corrected one; not where parts differ."""
        laid = LaidTrace(Trace.concatenate(self.felt), deviation.base)
        laid = LaidTrace.of(deviation.without_drift(laid), deviation.base)
        if deviation.parts:
            laid = laid.within(deviation.outside(laid.feet().points))
        self.survey = replace(self.survey, base=deviation.base)
        self.found.crossings.clear()
        self.found.noise = self.given_noise
        self.found.unseen.clear()
        self._detect([laid])

    def covered(self) -> Coverage:
        """How much of the surface lies near enough to a sweep to see the smallest feature."""
        return self.survey.covered(self.paths, self.survey.strip(self.visible))

    def _widen(self, first: Trace) -> None:
        """Strips as wide as the noise of a first sweep allows the smallest feature to be seen."""
        if len(first) < FEWEST_SWEEP_SAMPLES:
            return
        smallest = self.survey.smallest
        limit = detect(first, self.survey.base, noise=self.found.noise, stated=self.stated).detection_limit
        if limit > smallest:
            shown = f"features lower than {length_text(limit, 2)}: a single sweep does not show them through the noise"
            if not np.isfinite(limit):
                shown = "some features of any height: samples lie too far apart for a single sweep to show them all"
            self.found.unseen.append(f"{shown}, though {length_text(smallest, 2)} was asked for")
        self.visible = float(
            np.clip(VISIBLE_HEIGHT_MARGIN * limit / smallest, LEAST_VISIBLE_SHARE, self.survey.visible)
        )

    def _detect(self, waiting: list[Trace]) -> None:
        felt = detect(
            waiting[0] if len(waiting) == 1 else Trace.concatenate(waiting),
            self.survey.base,
            noise=self.found.noise,
            stated=self.stated,
            false_alarms_per_metre=CANDIDATES * self.false_alarms_per_metre,
        )
        self.found.noise = felt.noise
        self.limit = felt.detection_limit
        self.found.reported = float(np.sqrt(felt.threshold**2 + 2.0 * np.log(CANDIDATES / REPORTABLE)))
        self.found.crossings.extend(felt.crossings)
        waiting.clear()
