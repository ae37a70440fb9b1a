"""Surveyor: carries the survey out, as closely as its first sweep asks for, and looks at what every sweep felt."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hw import Move
from mapping import FloatArray, Trace, length_text
from mapping.base import LaidTrace
from mapping.detection import Coverage, Crossing, detect, expected_limit
from mapping.estimate.deviation import WIDE_PART, Deviation, Part, explain, lay_out
from mapping.instrument import Noise, StatedNoise
from planners import Meanwhile, Outcome, Plan, executed
from planners.explore.found import Found
from planners.paths import Isoline
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
# Height that must stay visible between two sweeps, in detection limits: the noise of a first sweep alone foretells the
# limit of all to 5 % (one standard deviation, in 12 explored logs)
VISIBLE_HEIGHT_MARGIN = 1.05
# Its least and its greatest share of the smallest feature's. Where white noise decides, the limit goes with the speed
# to the power 2/5, and area is swept fastest, at the speed times the root of what may be lost, where the limit is 5/6
# of the height asked for: closer sweeps cost more than slower ones
LEAST_VISIBLE_SHARE, MOST_VISIBLE_SHARE = 0.1, 5.0 / 6.0
# Sweeps that were laid out before the first told the noise stand if what it told leaves so much of the surface
# inspected, and would make strips no wider than by one over that; so much is asked of a run in the end
STANDS = 0.95
# Sweeps that are laid out before they are made: one line in two may give none at all in narrow places
SWEEPS_AHEAD = 2
# Samples that a sweep must have to be looked at
FEWEST_SWEEP_SAMPLES = 16


@dataclass
class SurveyCount:
    """How far a survey is, for whoever watches it.

    Args:
        planned: sweeps that it wants, known once the first has told the noise; None before. A line is one, until it is
            known whether ball and stem can make it whole.
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
        expected: limit of a single sweep in the analysis of all, m, as what is known of the noise foretells it; None
            where nothing does.
        given_noise: that was known before the survey; None: none.
        visible: share of the smallest feature's height that stays visible between two sweeps.
        paths: touched by the sweeps so far, each (K, 3), m.
        felt: by each sweep that felt anything, those of later looks included.
        commanded: paths of the ball's centre (K, 3) that were carried out, m.
        limit: least height that the sweeps detect one by one, m.
        metres: length of all lines that are laid out, m.
        parts: where the body differs from its model alone, by what was felt: nothing is looked for there.
        count: kept up as it goes.
        meanwhile: takes what can be worked out while the finger moves.
    """

    survey: Survey
    found: Found
    false_alarms_per_metre: float
    stated: StatedNoise | None = None
    count: SurveyCount = field(default_factory=SurveyCount)
    expected: float | None = None
    meanwhile: Meanwhile = field(default_factory=Meanwhile)
    visible: float = field(init=False)
    given_noise: Noise | None = field(init=False)
    paths: list[FloatArray] = field(init=False, default_factory=list)
    felt: list[Trace] = field(init=False, default_factory=list)
    commanded: list[FloatArray] = field(init=False, default_factory=list)
    limit: float = field(init=False, default=0.0)
    metres: float = field(init=False, default=0.0)
    parts: tuple[Part, ...] = field(init=False, default=())
    _waiting: list[Trace] = field(init=False, default_factory=list)  # felt, but not detected yet
    _felt_metres: float = field(init=False, default=0.0)
    _again: Iterator[Move] | None = field(init=False, default=None)  # the sweeps where the first ones did not stand

    def __post_init__(self) -> None:
        self.visible = self.survey.visible if self.expected is None else self._visible_for(self.expected)
        self.given_noise = self.found.noise

    def plan(self) -> Plan:
        """Every sweep of the survey; the first ones are detected together, for they tell the noise.

        What a sweep felt is looked at while the next one is made. So is whether the sweeps stand, by the first, if
        something foretold that they will.
        """
        strips = self.survey.crossed(self.survey.visible) is None
        if not strips:
            self.visible = self.survey.visible
        sweeps, judged, made = self._laid_out(), not strips, list[tuple[Sequence[Move], LaidTrace]]()
        while (move := next(sweeps, None)) is not None or made:
            if move is not None:
                answer = yield move
                self.count.made += 1
                made.append((executed(move, answer), LaidTrace.of(answer, self.survey.base)))
                self._keep(*made[-1])
                if not judged and len(made) == 1:
                    self.meanwhile.later(partial(self._judge, *made[0]))
                    if self.expected is not None:
                        continue
            if not judged:
                self.meanwhile.finish()
                judged = True
                if self._again is not None:
                    sweeps = self._again
                    made.clear()
                    continue
            for each in made:
                self.meanwhile.later(partial(self._look_at, *each))
            made.clear()
        self.meanwhile.finish()
        if self._waiting:
            self._detect(self._waiting)
        return Outcome("done")

    def _judge(self, done: Sequence[Move], first: Trace) -> None:
        """Lay the sweeps out again if they do not stand as they are."""
        if not self._stands(done, first):
            self._again = self._laid_out()

    def _look_at(self, done: Sequence[Move], trace: LaidTrace) -> None:
        """Note what was swept, and detect what it shows, the first sweeps together."""
        self.paths.extend(self.survey.touched(part) for part in done)
        if not done:
            self.found.left_out.append("a survey sweep was not carried out")
            return
        if len(trace) == 0:
            self.found.left_out.append("a survey sweep felt no contact")
            return
        self._waiting.append(trace)
        self._felt_metres += sum(part.length for part in done)
        if self.found.noise is not None or self._felt_metres >= FIRST_NOISE_PATH * self.survey.tip_radius:
            self._detect(self._waiting)

    def _laid_out(self) -> Iterator[Move]:
        """The sweeps. What ball and stem can make of a line may take 90 ms in narrow places: it is worked out while
        an earlier one is swept."""
        lines = deque(self.survey.lines(self.visible))
        self.metres = sum(line.length for line in lines)
        ahead = deque[list[Move]]()
        self._lay_ahead(lines, ahead)
        return self._in_turn(lines, ahead)

    def _lay_ahead(self, lines: deque[Isoline], ahead: deque[list[Move]]) -> None:
        """Lay out lines until enough sweeps are ahead."""
        while lines and sum(map(len, ahead)) < SWEEPS_AHEAD:
            ahead.append(list(self.survey.pressed(lines.popleft())))

    def _in_turn(self, lines: deque[Isoline], ahead: deque[list[Move]]) -> Iterator[Move]:
        """The sweeps that are laid out, while others are."""
        while ahead:
            sweeps = deque(ahead.popleft())
            while sweeps:
                self.count.planned = self.count.made + len(sweeps) + sum(map(len, ahead)) + len(lines)
                sweep = sweeps.popleft()
                self.meanwhile.later(partial(self._lay_ahead, lines, ahead))
                yield sweep
            if not ahead:
                self.meanwhile.finish()
        self.count.planned = self.count.made

    def _keep(self, done: Sequence[Move], trace: Trace) -> None:
        self.commanded.extend(part.path for part in done)
        self.felt.extend([trace] if len(trace) else [])

    def judge_model(self) -> list[Deviation | None]:
        """Work out meanwhile what all that was felt shows to be wrong with the model: put into the list, None if it is
        nothing."""
        shown: list[Deviation | None] = []
        felt, commanded = tuple(self.felt), tuple(self.commanded)
        self.meanwhile.later(lambda: shown.append(self._explained(felt, commanded)))
        return shown

    def _explained(self, felt: Sequence[Trace], commanded: Sequence[FloatArray]) -> Deviation | None:
        base = self.survey.base
        return explain(LaidTrace.together(felt, base), base, commanded, self.metres) if felt else None

    def look_again(self, deviation: Deviation) -> None:
        """What was found on a wrong model is forgotten, and looked for on the corrected one; not where parts differ."""
        laid = LaidTrace(Trace.concatenate(self.felt), deviation.base)
        laid = LaidTrace.of(deviation.without_drift(laid), deviation.base)
        self.parts = deviation.parts
        if deviation.parts:
            laid = laid.within(deviation.outside(laid.feet().points))
        self.survey = replace(self.survey, base=deviation.base)
        self.found.crossings.clear()
        self.found.tried.clear()
        self.found.noise = self.given_noise
        self.found.unseen.clear()
        self._detect([laid])

    def watched(self, plan: Plan) -> Plan:
        """A plan that goes on from the survey; what it feels is kept, too."""
        answer: Trace | None = None
        while True:
            try:
                move = next(plan) if answer is None else plan.send(answer)
            except StopIteration as end:
                outcome: Outcome = end.value
                return outcome
            answer = yield move
            self._keep(executed(move, answer), LaidTrace.of(answer, self.survey.base))

    def may_be_part(self, seed: Crossing) -> bool:
        """True if what was detected may belong to a part: one is known, or it is as wide as the least of them."""
        return bool(self.parts) or 2.0 * seed.half_width >= WIDE_PART * self.survey.tip_radius

    def look_for_parts(self) -> None:
        """Find the parts meanwhile by all that was felt by now, and forget what was detected on them.

        A survey may cross one once, as it would a groove, or its rim alone; what goes round it tells.
        """
        self.meanwhile.later(partial(self._find_parts, tuple(self.felt), tuple(self.commanded)))

    def _find_parts(self, felt: Sequence[Trace], commanded: Sequence[FloatArray]) -> None:
        deviation = self._explained(felt, commanded)
        self.parts = () if deviation is None else deviation.parts
        self.found.crossings[:] = self.off_parts(self.found.crossings)

    def off_parts(self, crossings: Sequence[Crossing]) -> tuple[Crossing, ...]:
        """Those that lie on no part."""
        return tuple(c for c in crossings if not any(part.covers(c.point[None])[0] for part in self.parts))

    def covered(self) -> Coverage:
        """How much of the surface lies near enough to a sweep to see the smallest feature."""
        return self.survey.covered(self.paths, self.survey.strip(self.visible))

    def _stands(self, done: Sequence[Move], first: Trace) -> bool:
        """True if the sweeps as laid out keep their promise in the noise of the first; else `visible` changes."""
        if len(first) < FEWEST_SWEEP_SAMPLES:
            return True
        smallest = self.survey.smallest
        felt = detect(first, self.survey.base, noise=self.found.noise, stated=self.stated)
        limit = felt.detection_limit
        if np.isfinite(limit):  # by a single sweep; of all together the noise is known better
            step = sum(part.length for part in done) / (len(first) - 1)
            limit = expected_limit(felt.noise, step, self.survey.tip_radius, self.false_alarms_per_metre)
        if limit > smallest:
            shown = f"features lower than {length_text(limit, 2)}: a single sweep does not show them through the noise"
            if not np.isfinite(limit):
                shown = "some features of any height: samples lie too far apart for a single sweep to show them all"
            self.found.unseen.append(f"{shown}, though {length_text(smallest, 2)} was asked for")
        laid_out, visible = self.visible, self._visible_for(limit)
        inspected = float(np.sqrt(max(1.0 - limit / smallest, 0.0) / (1.0 - laid_out)))
        wider = self.survey.strip(visible) / self.survey.strip(laid_out)
        if (inspected >= STANDS or visible == laid_out) and wider <= 1.0 / STANDS:
            return True
        self.visible = visible
        return False

    def _visible_for(self, limit: float) -> float:
        """Share of the smallest feature's height to leave visible between two sweeps that show what is so high, m.

        The survey's own share where no sweep shows the smallest feature: none would be gained by closer ones.
        """
        smallest = self.survey.smallest
        if limit >= smallest:
            return self.survey.visible
        return float(np.clip(VISIBLE_HEIGHT_MARGIN * limit / smallest, LEAST_VISIBLE_SHARE, MOST_VISIBLE_SHARE))

    def _detect(self, waiting: list[Trace]) -> None:
        laid = LaidTrace.together(waiting, self.survey.base)
        felt = detect(
            laid,
            self.survey.base,
            noise=self.found.noise,
            stated=self.stated,
            false_alarms_per_metre=CANDIDATES * self.false_alarms_per_metre,
        )
        self.found.noise = felt.noise
        self.limit = felt.detection_limit
        self.found.reported = float(np.sqrt(felt.threshold**2 + 2.0 * np.log(CANDIDATES / REPORTABLE)))
        self.found.crossings.extend(felt.crossings)
        lay_out(laid, self.metres)
        waiting.clear()
