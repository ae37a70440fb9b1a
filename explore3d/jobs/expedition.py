"""Expedition: the finger finds out what it explores on, then explores; every move is checked and routed.

`explorer` is the one place where a scene becomes exploratory procedures: `run`, `plan` and the bench build theirs here.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter, process_time, thread_time
from typing import TYPE_CHECKING, Any

import numpy as np

from explore3d import SceneError, seconds_text
from explore3d.analysis import Computing
from explore3d.log import KIND, NOISE, SURVEY, Stop, base_event
from explore3d.scene import extent_text
from hw import FingerError, Move, Workspace
from mapping import FloatArray, Trace, length_text
from mapping.base import Base
from mapping.geometry.mesh import asked_part
from planners import Meanwhile, Outcome, Plan, Spent, Survey, drive, within
from planners.explore import Discover, Explore, Locate, SurveyCount
from planners.paths import FeltDetails, Limits, Ways, routed

if TYPE_CHECKING:
    from explore3d.scene import Scene

# Times the time budget that a survey may be foretold to take: nobody resumes a run so often, while a length that is
# wrong by its unit, in cm for mm at the least, makes it a hundredfold. Laying out so many sweeps of 10 min takes 10 s
MOST_BUDGETS = 100.0
# An unknown body stands on something: where no side is named it is approached from above
ABOVE = ("+z",)
Execute = Callable[[Move], Trace]
# Told the kind of an event, and its data
Event = Callable[[str, dict[str, Any]], None]


def unheard(kind: str, data: dict[str, Any]) -> None:
    """An event that nobody notes."""


@dataclass
class Waits:
    """Carries out moves, and keeps how long the finger waited for each: planning, checks, ways, and writing it down.

    In CPU time of this program, so that what else a computer does is not counted; what carries a move out (where the
    finger is simulated, that is much) is counted by itself. What the plan hands over for it is worked out while the
    finger moves, in a thread of its own, and makes it wait only as far as it takes longer than the move. A simulated
    finger has the time that a real one would take.

    Args:
        execute: carries out one move.
        travel_speed: of the straight way to a move from where the one before ended, m/s.
        meanwhile: takes what can be worked out while the finger moves.
        each: before every move, s; the first one holds what was made ready before anything moved.
        carrying_out: of all moves, s.
        worked: while the finger moved, s.
    """

    execute: Execute
    travel_speed: float = np.inf
    meanwhile: Meanwhile = field(init=False, default_factory=Meanwhile)
    each: list[float] = field(init=False, default_factory=list)
    carrying_out: float = field(init=False, default=0.0)
    worked: float = field(init=False, default=0.0)
    _since: float = field(init=False, default_factory=process_time)
    _late: float = field(init=False, default=0.0)  # what the work beside the last move took longer than that
    _after: float = field(init=False, default=0.0)
    _moved: Spent = field(init=False)

    def __post_init__(self) -> None:
        self._moved = Spent(self.travel_speed)

    @property
    def planning(self) -> float:
        """What all waits come to, what was worked out while the finger moved, and what the plan did after its last
        move, s."""
        return sum(self.each) + self.worked + self._after

    def ended(self) -> None:
        """The plan is over."""
        self._after = process_time() - self._since
        gc.unfreeze()

    def computing(self, modelling: float) -> Computing:
        """The account of a run whose modelling took so long (s)."""
        return Computing(self.planning, modelling, self.median, self.worst)

    @property
    def median(self) -> float:
        """For a move after the first, s; 0 if there is none."""
        return float(np.median(self.each[1:])) if self.each[1:] else 0.0

    @property
    def worst(self) -> float:
        """For a move after the first, s; 0 if there is none."""
        return max(self.each[1:], default=0.0)

    def __call__(self, move: Move) -> Trace:
        if not self.each:
            gc.freeze()
        begin, before = process_time(), self._moved.seconds
        self.each.append(begin - self._since + self._late)
        self._moved.count(move)
        beside = _Beside(self.meanwhile, self._moved.seconds - before)
        try:
            with beside:
                return self.execute(move)
        finally:
            self._since, self._late = process_time(), beside.late
            self.worked += beside.seconds - beside.late
            self.carrying_out += self._since - begin - beside.seconds


class _Beside:
    """Works beside a move, in a thread of its own: until the move is over and its time is, too.

    Args:
        meanwhile: what there is to do.
        moving: how long the finger moves, s.
    """

    def __init__(self, meanwhile: Meanwhile, moving: float) -> None:
        self.meanwhile, self.moving = meanwhile, moving
        self.seconds = 0.0  # worked, in CPU time
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._work, name="beside a move") if meanwhile.waiting else None

    @property
    def late(self) -> float:
        """How much longer the work took than the move, s."""
        return max(0.0, self.seconds - self.moving)

    def _work(self) -> None:
        begin = thread_time()
        while self.meanwhile.waiting and (self.seconds < self.moving or not self._over.is_set()):
            self.meanwhile.work()
            self.seconds = thread_time() - begin

    def __enter__(self) -> None:
        self._begin = perf_counter()
        if self._thread is not None:
            self._thread.start()

    def __exit__(self, *raised: object) -> None:
        self.moving = max(self.moving, perf_counter() - self._begin)
        self._over.set()
        if self._thread is not None:
            self._thread.join()


@dataclass
class SurveyWatch:
    """Carries out moves, and knows how far the survey is.

    Args:
        execute: carries out one move.
        event: told how many sweeps the survey has, and again where that changes.
        count: how far the survey's own account is.
    """

    execute: Execute
    event: Event
    count: SurveyCount = field(default_factory=SurveyCount)
    refused: str = field(init=False, default="")  # why the finger did not carry out the last move that it refused
    _sweeps: int = field(init=False, default=0)
    _before: int = field(init=False, default=0)
    _told: int | None = field(init=False, default=None)

    def begun(self) -> SurveyCount:
        """The count to keep up: the survey begins, what was swept before was to know the base."""
        self._before = self._sweeps
        return self.count

    def __call__(self, move: Move) -> Trace:
        if self.count.planned != self._told:
            self._told = self.count.planned
            self.event(SURVEY, {"sweeps": self.count.planned, "before": self._before})
        try:
            trace = self.execute(move)
        except FingerError as error:
            self.refused = str(error)
            raise
        self._sweeps += move.purpose == "sweep"
        return trace

    @property
    def made(self) -> int:
        """Sweeps of the survey that the finger made; those that it refused do not count."""
        made = self._sweeps - self._before
        return made if self.count.planned is None else min(made, self.count.planned)

    @property
    def surveyed(self) -> bool:
        """True if the survey came to its end; a single sweep of it may have been refused."""
        return self.count.planned is not None and self.count.made >= self.count.planned

    def stop(self, cause: str) -> Stop:
        """What to say if it ends now."""
        return Stop(cause, self.made, self.count.planned)


def explorer(scene: Scene, workspace: Workspace) -> Explorer:
    """All that a scene says of exploring with a finger of that workspace.

    Raises:
        SceneError: a mesh that cannot be read, a region without surface or too small for a sweep, or a speed that
            cannot be known.
    """
    model, tip, smallest = scene.model, scene.tip.radius, scene.smallest
    speed, force = scene.sweep_speed, scene.survey.force
    base = known_base(scene)
    discover = locate = None
    if base is None and model.region is not None:
        discover = Discover(
            low=np.array(model.region.low),
            high=np.array(model.region.high),
            tip_radius=tip,
            smallest=smallest,
            sides=model.sides or ABOVE,
            speed=speed,
            force=force,
        )
    elif base is not None and model.pose == "estimate":
        locate = Locate(
            base=base,
            tip_radius=tip,
            smallest=smallest,
            sides=model.facing,
            shift=model.shift,
            turn=model.turn,
            speed=speed,
            force=force,
        )
    explore = partial(
        Explore,
        tip_radius=tip,
        smallest=smallest,
        precision=scene.explore.precision,
        **model.asked,
        speed=speed,
        force=force,
        shortest_ridge=scene.survey.shortest_ridge,
        travel_speed=workspace.max_speed,
        false_alarms_per_metre=scene.detection.false_alarms_per_metre,
        stated=scene.noise,
        expected=scene.expected_limit,
    )
    if base is not None and model.part is not None and next(explore(base=base).survey.lines(), None) is None:
        raise SceneError(
            f"{scene.path}: model.region: no sweep fits into it: of its surface no line is as long as a tenth of the "
            f"{length_text(explore(base=base).survey.pitch, 2)} between sweeps; found {_box_text(*model.part)}"
        )
    return Explorer(base, discover, locate, explore, workspace, tip, scene.explore.time_budget)


def known_base(scene: Scene) -> Base | None:
    """The global model that the scene gives, None if it gives a region alone.

    Raises:
        SceneError: a mesh that cannot be used, none of its surface lies in the region and faces one of the sides, the
            smallest feature is larger than it, or a survey of it takes so much more than the time budget that a unit
            must be wrong.
    """
    surface, part = scene.base_surface(), scene.model.part
    if surface is None:
        return None
    if part is not None and asked_part(surface, part) is None:
        raise SceneError(
            f"{scene.path}: model.region: the mesh has no surface in it; found {_box_text(*part)}, possible is what "
            f"meets the mesh, {_box_text(*surface.bounds)}"
        )
    if asked_part(surface, **scene.model.asked) is None:
        raise SceneError(
            f"{scene.path}: model.sides: no face of the mesh that is to be explored lies within 60 degrees of one of "
            f"them; found {', '.join(scene.model.sides or ())}; turn the mesh, or name other sides"
        )
    if scene.smallest >= (size := float(np.ptp(surface.vertices, axis=0).max())):
        raise SceneError(
            f"{scene.path}: survey.smallest_feature: {length_text(scene.smallest)} high on a mesh of "
            f"{length_text(size)}; nothing so high fits on it: are the units of both the right ones?"
        )
    base = Base(surface)
    seconds, sentence = foretold_survey(scene, base)
    if seconds > MOST_BUDGETS * scene.explore.time_budget:
        raise SceneError(
            f"{scene.path}: model.units: {sentence}; found {scene.model.units!r}, is that the mesh's unit? If it is, "
            f"raise survey.smallest_feature ({length_text(scene.smallest)}) or explore.time_budget, or name a "
            "model.region"
        )
    return base


def foretold_survey(scene: Scene, base: Base) -> tuple[float, str]:
    """Finger time of the survey before any sweep is laid out, s, and a sentence by which a wrong unit is noticed."""
    survey = Survey(
        base=base,
        tip_radius=scene.tip.radius,
        smallest=scene.smallest,
        shortest_ridge=scene.survey.shortest_ridge,
        **scene.model.asked,
    )
    seconds, size = survey.foretold_path / scene.sweep_speed, extent_text(survey.surface or base.surface)
    return seconds, (
        f"the sweeps over {size} take about {seconds_text(seconds)} at {1e3 * scene.sweep_speed:.3g} mm/s without the "
        f"ways between them, and the time budget is {seconds_text(scene.explore.time_budget)}"
    )


def _box_text(low: FloatArray, high: FloatArray) -> str:
    """The extent of a box along each axis in words, mm."""
    sides = zip("xyz", 1e3 * low, 1e3 * high, strict=True)
    return ", ".join(f"{axis} from {start:.6g} to {stop:.6g} mm" for axis, start, stop in sides)


@dataclass(frozen=True, eq=False)
class Explored:
    """What a finished expedition knows.

    Args:
        base: that it explored on: as given, where the object stands, or as found; None if none was found.
        found: the exploration's own account (planners.explore.found.Found); None if it did not come to that.
    """

    base: Base | None
    found: Any = None


@dataclass(frozen=True, eq=False)
class Explorer:
    """The procedures, checks and ways of one expedition, made before anything moves.

    Args:
        given: the global model as the scene gives it; None if it gives a region alone.
        discover: finds the body in its region; None if it is given.
        locate: finds where it stands; None if it stands as given.
        explore: the exploration of a base with the scene's settings; wants `base` and `time_budget` (s).
        workspace: of the finger.
        tip_radius: m.
        time_budget: finger time for everything, s.
    """

    given: Base | None
    discover: Discover | None
    locate: Locate | None
    explore: partial[Explore]
    workspace: Workspace
    tip_radius: float
    time_budget: float

    @property
    def nothing(self) -> Trace:
        """What a move gives that touches nothing."""
        return Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), self.tip_radius)

    def limits(self, base: Base | None) -> Limits:
        """What every move must keep to: off the base, and off what the moves feel to stand out of it."""
        felt = None if base is None else FeltDetails(base, self.tip_radius)
        return Limits.of(self.workspace, base, self.tip_radius, felt)

    def prepared(
        self, plan: Plan, base: Base | None, spent: Spent, seconds: float, limits: Limits | None = None
    ) -> Plan:
        """The plan within `seconds` of finger time, counted in `spent`, on ways that lead round the base.

        Args:
            limits: what a move is checked by, if the driver checks it by the same: it is not checked twice then.
        """
        plan = within(plan, spent, seconds)
        if base is None:
            return plan
        space, limits = self.workspace, limits or self.limits(base)
        ways = Ways(base, self.tip_radius, space.low, space.high, space.max_speed, limits.felt)
        ways.make_ready()
        return routed(plan, ways, limits.violation)

    def carry_out(
        self, plan: Plan, base: Base | None, execute: Execute, event: Event = unheard, seconds: float = np.inf
    ) -> tuple[Outcome, float]:
        """Drive a plan with every check; why it ended, and the finger time that it took, s.

        Args:
            base: that the moves must not run into; None while it is unknown.
            execute: carries out one move.
            event: told what was refused.
            seconds: finger time that the plan may take.
        """
        spent, limits = Spent(self.workspace.max_speed), self.limits(base)

        def refused(move: Move, why: str) -> None:
            what = f"{move.purpose} not executed: {why}"
            event("refused", {"what": what, "purpose": move.purpose, "path": move.path.tolist()})

        _, outcome = drive(
            self.prepared(plan, base, spent, seconds, limits),
            execute,
            check=limits.violation,
            refused_move=refused,
            empty=self.nothing,
        )
        return outcome, spent.seconds

    def go(
        self,
        execute: Execute,
        event: Event = unheard,
        watch: SurveyWatch | None = None,
        meanwhile: Meanwhile | None = None,
    ) -> Outcome:
        """Find the base, explore it; why it ended, with an Explored as its value.

        Args:
            execute: carries out one move.
            event: told the base, what was refused, and the noise as it was measured on the way.
            watch: counts the sweeps of the survey, if anyone asks.
            meanwhile: takes what can be worked out while the finger moves; what `execute` does not do of it, the plan
                does when it needs it.
        """
        outcome, seconds = self._base(execute, event)
        base: Base | None = outcome.value
        if base is None:
            return replace(outcome, value=Explored(None))
        left = self.time_budget - seconds
        if left <= 0:
            detail = f"the budget was spent before exploring began: {outcome.detail}"
            return Outcome("budget", detail, Explored(base))
        plan = self.explore(base=base, time_budget=left).plan(
            count=None if watch is None else watch.begun(), meanwhile=meanwhile
        )
        found, _ = self.carry_out(plan, base, execute, event, left)
        if found.value is not None and found.value.noise is not None:
            event(NOISE, found.value.noise.record)
        detail = f"{found.detail}; before that, to know the base: {outcome.detail}" if outcome.detail else found.detail
        return Outcome(found.reason, detail, Explored(base, found.value))

    def _base(self, execute: Execute, event: Event) -> tuple[Outcome, float]:
        """The base to explore on, as the outcome's value: as given, where the object stands, or as discovered; and
        the finger time that it took, s."""
        if self.given is not None:
            event(KIND, base_event(self.given))
        if self.locate is not None:
            found, seconds = self.carry_out(self.locate.plan(), self.given, execute, event, self.time_budget)
            base = None if found.value is None else found.value.moved(self.given)
        elif self.discover is not None:
            found, seconds = self.carry_out(self.discover.plan(), None, execute, event, self.time_budget)
            base = found.value
        else:
            return Outcome("done", value=self.given), 0.0
        if base is not None:
            event(KIND, base_event(base))
        return replace(found, value=base), seconds
