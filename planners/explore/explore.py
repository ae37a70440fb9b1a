"""Explore: surveys the base, then does what sharpens the features most per second, and stops when it is enough."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from hw import Move
from mapping import FloatArray, Trace, length_text
from mapping.base import Base
from mapping.detection import Crossing
from mapping.instrument import Noise, StatedNoise
from planners import Meanwhile, Outcome, Plan, PlannerError, Spent, within
from planners.explore.faint_search import CloserLook, FaintSearch
from planners.explore.found import Found
from planners.explore.surveyor import CANDIDATES, SurveyCount, Surveyor
from planners.explore.warm_up import get_ready
from planners.follow import (
    AxisEnd,
    AxisTrack,
    BumpSize,
    BumpSizer,
    Circuit,
    Crest,
    EndFinder,
    FaintFollower,
    FaintLead,
    RidgeFollower,
    Sense,
    headings,
    is_step,
    slender,
)
from planners.paths import Strokes
from planners.survey import Survey

# Why a detection is passed over (see Found.passed_over)
LOWER = "lower than the smallest feature asked for and hardly above the noise"


@dataclass(frozen=True)
class Action:
    """One thing that could be done next: what for, what it is expected to gain (m) and take (s), how to do it."""

    name: str
    gain: float
    seconds: float
    start: Callable[[], Plan]


@dataclass(frozen=True, eq=False, kw_only=True)
class Explore:
    """Survey, circle, follow, bisect, slide, stop.

    After the survey the next action is always the one with the largest expected reduction of the features'
    uncertainty per second of finger time: looking into a detection (its extent is unknown by about a survey
    pitch) or sharpening an end that is not precise enough. It stops when nothing is left to gain.

    Args:
        base: the global model.
        tip_radius: m.
        smallest: height of the smallest feature to be found, m.
        precision: wanted half-width of the 90 % interval of a feature's end or centre, m.
        speed, force: of the sweeps, m/s and N.
        shortest_ridge: distance between the ends of the shortest ridge to be found, m; None: bumps as well.
        region: (low, high) corners (3,) of the part to be inspected, m; None: all of the base.
        sides: (S, 3) outward directions: what faces none of them is not inspected; None: all is.
        time_budget: finger time, s.
        path_budget: finger path, m.
        travel_speed: between sweeps, m/s; None: 25 tip radii per second.
        false_alarms_per_metre: accepted rate of false crossings, 1/m.
        noise: of the samples; None: learnt from the first sweeps.
        stated: what is known of the noise before, say from a data sheet; learning begins from it.
        expected: limit of detection that is foretold from that, m; None: nothing is known.
    """

    base: Base
    tip_radius: float
    smallest: float
    precision: float = 1e-4
    speed: float = 0.03
    force: float = 1.0
    shortest_ridge: float | None = None
    region: tuple[FloatArray, FloatArray] | None = None
    sides: FloatArray | None = None
    time_budget: float = np.inf
    path_budget: float = np.inf
    travel_speed: float | None = None
    false_alarms_per_metre: float = 0.01
    noise: Noise | None = None
    stated: StatedNoise | None = None
    expected: float | None = None

    def __post_init__(self) -> None:
        for name in ("tip_radius", "smallest", "precision", "speed", "time_budget"):
            if not getattr(self, name) > 0:
                raise PlannerError(f"explore: {name} must be positive; found {getattr(self, name)}")

    @property
    def wanted_sd(self) -> float:
        """Standard deviation whose 90 % interval is the wanted precision, m."""
        return self.precision / 1.645

    @cached_property
    def survey(self) -> Survey:
        """The survey that it begins with."""
        return Survey(
            base=self.base,
            tip_radius=self.tip_radius,
            smallest=self.smallest,
            speed=self.speed,
            force=self.force,
            shortest_ridge=self.shortest_ridge,
            region=self.region,
            sides=self.sides,
        )

    @property
    def strokes(self) -> Strokes:
        """Sweeps with this fingertip on this base."""
        return Strokes(self.base, self.tip_radius, self.speed, self.force)

    def plan(
        self,
        rng: np.random.Generator | None = None,
        count: SurveyCount | None = None,
        meanwhile: Meanwhile | None = None,
    ) -> Plan:
        """The whole exploration; the outcome's value is a Found. Nothing in it is random: `rng` is not used.

        Args:
            count: is kept up while the survey goes on.
            meanwhile: takes what can be worked out while the finger moves; whoever carries the moves out may do it.
        """
        get_ready(self.tip_radius)
        found = Found(self.tip_radius, noise=self.noise)
        spent = Spent(self._travel_speed)
        count = SurveyCount() if count is None else count
        meanwhile = Meanwhile() if meanwhile is None else meanwhile
        surveyor = Surveyor(
            self.survey, found, self.false_alarms_per_metre, self.stated, count, self.expected, meanwhile
        )
        everything = self._everything(surveyor, found)
        outcome = yield from within(everything, spent, self.time_budget, self.path_budget)
        if found.surveyed:
            self._account(surveyor, found)
        if over := found.passed_over():
            found.left_out.append(f"{_counted(over, 'detection')} not looked into: {LOWER}")
        if outcome.reason == "budget":
            found.left_out.append(f"{_counted(len(found.unexplained()), 'detection')} not looked into: budget spent")
        told = outcome.detail if outcome.reason == "model wrong" else self._why(outcome.reason, found)
        why = f"{told}, after {spent.seconds:.0f} s and {spent.metres:.3g} m of finger path"
        return Outcome(outcome.reason, "; not inspected for ".join([why, *found.unseen]), found)

    @staticmethod
    def _why(reason: str, found: Found) -> str:
        """Why it ended, in words."""
        if reason == "budget":
            return f"the budget was spent, with {_counted(len(found.unexplained()), 'detection')} not looked into"
        if reason == "nothing found":
            return "the survey found nothing to look into"
        if over := found.passed_over():
            return f"nothing was left to sharpen, and {_counted(over, 'detection')} not looked into, {LOWER}"
        return "every detection was looked into and nothing was left to sharpen"

    def _account(self, surveyor: Surveyor, found: Found) -> None:
        """What the survey does not cover, told when the finger has nothing to wait for any more."""
        if surveyor.survey.crossed(surveyor.visible) is not None:
            found.unseen.append(
                f"features smaller than a ridge that spans {1e3 * (self.shortest_ridge or 0.0):g} mm: "
                f"{100 * surveyor.covered().fraction:.0f} % of the surface lies near enough to a sweep to see them"
            )

    def _everything(self, surveyor: Surveyor, found: Found) -> Plan:
        yield from surveyor.plan()
        found.surveyed, found.asked = True, surveyor.visible * self.smallest
        judged = surveyor.judge_model()
        if not found.unexplained():
            surveyor.meanwhile.finish()  # there is nothing to go to before
        hunted = yield from self._begun(self._hunt(surveyor, found), surveyor, lambda: judged == [None])
        if hunted is not None:
            return hunted
        (deviation,) = judged
        assert deviation is not None  # the hunt would have gone on
        found.actions.append(deviation.sentence())
        if deviation.beyond_repair:
            found.left_out.append("circuits, ridge following and sizing: the model is wrong beyond repair")
            return Outcome("model wrong", f"{deviation.sentence()}; what is needed is {deviation.needs()}")
        surveyor.look_again(deviation)
        outcome = yield from replace(self, base=deviation.base)._hunt(surveyor, found)
        return outcome

    @property
    def _travel_speed(self) -> float:
        return 25.0 * self.tip_radius if self.travel_speed is None else self.travel_speed

    def _hunt(self, surveyor: Surveyor, found: Found) -> Plan:
        """Look into what the survey showed, until nothing is left to sharpen."""
        yield from self._faint(surveyor, found)
        if not found.crossings and not found.leads:
            found.left_out.append("circuits, ridge following and sizing: the survey found nothing")
            return Outcome("nothing found")
        sense = Sense(self.base, found.noise, self.false_alarms_per_metre)
        while actions := self._actions(surveyor, found, sense):
            best = max(actions, key=lambda action: action.gain / action.seconds)
            outcome = yield from surveyor.watched(best.start())
            found.actions.append(f"{best.name}: {outcome.reason}" + (f" ({outcome.detail})" if outcome.detail else ""))
        return Outcome("done")

    def _faint(self, surveyor: Surveyor, found: Found) -> Plan:
        """Where no single sweep shows the smallest ridge asked for, look for lines that many show."""
        rate = CANDIDATES * self.false_alarms_per_metre
        noise, learns = found.noise or Noise(0.0), self.noise is None
        search = FaintSearch(self.survey, surveyor.limit, noise, rate, learns, self.stated)
        if self.survey.crossed(self.survey.visible) is None or search.crossings == 1:
            return Outcome("not needed")
        searched = yield from search.plan()
        look: CloserLook = searched.value
        found.crossings.extend(look.crossings)
        found.noise = look.noise or found.noise
        found.actions.append(f"closer survey: {searched.detail}")
        found.leads.extend(look.leads)
        return searched

    def _follow_lead(self, lead: FaintLead, found: Found, sense: Sense) -> Plan:
        """Follow a faint line, unless what was followed since explains it."""
        found.leads.remove(lead)
        if any(track.distance(lead.seed.point) < 1.5 * track.half_width for track in found.tracks):
            return Outcome("known", "it lies on an axis that was followed before")
        follower = FaintFollower(self.strokes, sense, found.noise or Noise(0.0), _known(found))
        followed = yield from follower.follow(lead)
        found.tracks.extend([] if followed.value is None else [followed.value])
        return Outcome(f"by up to {lead.passes} passes", followed.detail)

    def _actions(self, surveyor: Surveyor, found: Found, sense: Sense) -> list[Action]:
        actions = []
        for seed in found.unexplained()[:1]:
            pitch = self.survey.pitch
            seconds = 2.0 * np.pi * self._circuit_radius(seed) / self.speed
            actions.append(Action("look into", pitch, seconds, partial(self._look_into, seed, surveyor, found, sense)))
        for lead in [] if actions else found.leads[:1]:
            # what single sweeps show comes first: it may be what the faint line is a part of
            seconds = lead.passes * lead.length / self.speed
            start = partial(self._follow_lead, lead, found, sense)
            actions.append(Action("follow a faint line", self.survey.pitch, seconds, start))
        for index, track in enumerate(found.tracks):
            for which, end in enumerate(track.ends):
                if (index, which) in found.sharpened or not self._is_doubtful(end, track):
                    continue
                way = float(np.linalg.norm(end.point - surveyor.felt[-1].centers[-1]))
                seconds = 4.0 * track.half_width / self.speed + way / self._travel_speed
                gain = end.sd if np.isfinite(end.sd) else self.survey.pitch
                actions.append(Action("sharpen an end", gain, seconds, partial(self._sharpen, index, which, found)))
        return actions

    def _is_doubtful(self, end: AxisEnd, track: AxisTrack) -> bool:
        """True if sweeps across a line about its end are worth it."""
        along, across = self._enough(track)
        return end.reason == "end" and not track.step and (end.sd > along or end.across_sd > across)

    def _enough(self, track: AxisTrack) -> tuple[float, float]:
        """Standard deviations of an end along and across its line down to which sweeps are worth it, m: what they
        cannot tell is left beside it."""
        unknown = Crest.of(track).rounding_sd(self.tip_radius)
        return float(np.sqrt(max(self.wanted_sd**2 - unknown**2, unknown**2))), self.wanted_sd

    def _circuit_radius(self, seed: Crossing) -> float:
        """Wide enough to go round a bump whose top lies up to half a survey pitch beside the sweep."""
        half_width = seed.half_width * min(1.0, 1.3 * slender(seed, self.tip_radius))
        return 1.4 * half_width + 0.5 * self.survey.pitch

    def _look_into(self, seed: Crossing, surveyor: Surveyor, found: Found, sense: Sense) -> Plan:
        """Circle a detection, then follow the ridge or size the bump that it belongs to.

        But not where the circuit shows that the body differs from its model: on such a part, or at its rim, from which
        all branches lead onto it.
        """
        found.tried.append(seed)
        edge = found.step_heading(seed, 3.0 * self.survey.pitch)
        if edge is not None:
            followed = yield from self._follower(found, sense).follow(seed, [edge, -edge])
            found.tracks.extend([] if followed.value is None else [followed.value])
            return Outcome("step", followed.detail)
        circled = yield from Circuit(self.strokes, sense, self._circuit_radius(seed)).around(seed)
        branches: tuple[Crossing, ...] = circled.value
        if surveyor.may_be_part(seed):
            surveyor.look_for_parts()
            shown = (seed, *branches)
            begun = yield from self._begun(
                self._follow_or_size(seed, circled, found, sense),
                surveyor,
                lambda: len(surveyor.off_parts(shown)) == len(shown),
            )
            if begun is not None:
                return begun
            beside = surveyor.off_parts(branches)
            if not surveyor.off_parts((seed,)) or (branches and not beside):
                return Outcome("part", "the body differs from its model there")
            circled = replace(circled, value=beside)
        return (yield from self._follow_or_size(seed, circled, found, sense))

    def _begun(
        self, plan: Plan, surveyor: Surveyor, right: Callable[[], bool]
    ) -> Generator[Move, Trace, Outcome | None]:
        """A plan whose first move is made while it is worked out whether it is right; None if it is not."""
        if not surveyor.meanwhile.waiting and not right():
            return None
        try:
            answer = yield next(plan)
            surveyor.meanwhile.finish()
            if not right():
                plan.close()
                return None
            while True:
                answer = yield plan.send(answer)
        except StopIteration as end:
            outcome: Outcome = end.value
            return outcome

    def _follow_or_size(self, seed: Crossing, circled: Outcome, found: Found, sense: Sense) -> Plan:
        """Follow the ridge or size the bump that was circled; the circuit's outcome has its branches."""
        branches: tuple[Crossing, ...] = circled.value
        if branches:
            seed, ways = _typed(seed, branches), headings(seed, branches, self.tip_radius)
        else:
            sized = yield from BumpSizer(self.strokes, sense, self.wanted_sd).size(seed)
            bump: BumpSize | None = sized.value
            if bump is None or bump.long_way is None:
                found.bumps.extend([] if bump is None else [bump])
                return Outcome(circled.reason, sized.detail)
            ways = [bump.long_way, -bump.long_way]
            seed = replace(seed, point=bump.point)
        followed = yield from self._follower(found, sense).follow(seed, ways)
        found.crossings.extend(branches)
        track: AxisTrack | None = followed.value
        if track is not None and any(track.repeats(other) for other in found.tracks):
            return Outcome("known", "it lies on an axis that was followed before")
        if track is not None:
            found.tracks.append(track)
        return Outcome(circled.reason, followed.detail)

    def _follower(self, found: Found, sense: Sense) -> RidgeFollower:
        noise = found.noise or Noise(0.0)
        return RidgeFollower(self.strokes, sense, noise, self.wanted_sd, known=_known(found))

    def _sharpen(self, index: int, which: int, found: Found) -> Plan:
        """Sweeps across a line about its end until that is known well enough; the way to it is paid once for all."""
        found.sharpened.add((index, which))
        track = found.tracks[index]
        finder = EndFinder(self.strokes, self.base, found.noise or Noise(0.0))
        end, crest = yield from finder.sharpen(track.ends[which], Crest.of(track), self._enough(track))
        # what one end tells of the height need not be felt at the other
        found.tracks[index] = replace(track, height=crest.height, height_sd=crest.height_sd).with_end(which, end)
        return Outcome(end.reason, f"end known to {length_text(end.sd)} along, {length_text(end.across_sd)} across")


def _known(found: Found) -> Callable[[FloatArray], bool]:
    """Tells whether a point lies on an axis that was found by now."""
    tracks = tuple(found.tracks)
    return lambda point: any(track.distance(point) < 0.5 * track.half_width for track in tracks)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


def _typed(seed: Crossing, branches: tuple[Crossing, ...]) -> Crossing:
    """The seed with the kind, height and width of the circuit's branches.

    A ridge swept lengthwise looks like a plateau between two steps; only a circuit crosses it squarely.
    """
    crests = [branch for branch in branches if not is_step(branch)]
    like = max(crests or branches, key=lambda c: abs(c.height))
    if is_step(seed) == is_step(like):
        return seed
    return replace(seed, kind=like.kind, height=like.height, half_width=like.half_width)
