"""Expedition: the finger finds out what it explores on, then explores; every move is checked, routed and logged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from explore3d import SceneError
from explore3d.log import KIND, LogWriter, base_event
from hw import Finger, Move
from mapping import Trace
from mapping.base import Base
from planners import Outcome, Plan, Spent, drive, within
from planners.explore import Discover, Explore, Locate
from planners.paths import Limits, Ways, routed

if TYPE_CHECKING:
    from explore3d.scene import Scene
    from planners.explore import Discover, Explore, Locate


@dataclass
class Expedition:
    """One finger on its way over one object.

    Args:
        scene: what to explore, and how.
        finger: opened.
        execute: carries out and logs one move.
        log: of the session.
        seconds: finger time that was spent so far.
    """

    scene: Scene
    finger: Finger
    execute: Callable[[Move], Trace]
    log: LogWriter
    seconds: float = field(default=0.0)

    def go(self) -> Outcome:
        """Find the base, explore it; why it ended."""
        outcome = self._base()
        base: Base | None = outcome.value
        if base is None:
            return outcome
        left = self.scene.explore.time_budget - self.seconds
        if left <= 0:
            return Outcome("budget", f"the budget was spent before exploring began: {outcome.detail}")
        found = self._carry_out(explorer(self.scene, base, left).plan(), base)
        detail = f"{found.detail}; before that, to know the base: {outcome.detail}" if outcome.detail else found.detail
        return replace(found, detail=detail)

    def _base(self) -> Outcome:
        """The base to explore on, as the outcome's value: as given, where the object stands, or as discovered."""
        given = known_base(self.scene)
        if given is None:
            found = self._carry_out(discoverer(self.scene).plan(), None)
            base = found.value
        else:
            self.log.event(KIND, base_event(given))
            if self.scene.model.pose == "given":
                return Outcome("done", value=given)
            found = self._carry_out(locator(self.scene, given).plan(), given)
            base = None if found.value is None else found.value.moved(given)
        if base is not None:
            self.log.event(KIND, base_event(base))
        return replace(found, value=base)

    def _carry_out(self, plan: Plan, base: Base | None) -> Outcome:
        workspace, tip = self.finger.workspace, self.scene.tip.radius
        spent = Spent(workspace.max_speed)
        plan = within(plan, spent, self.scene.explore.time_budget - self.seconds)
        limits = Limits.of(workspace, base, tip)
        if base is not None:
            ways = Ways(base, tip, workspace.low, workspace.high, workspace.max_speed)
            plan = routed(plan, ways, limits.violation)
        _, outcome = drive(
            plan,
            self.execute,
            check=limits.violation,
            refused_move=self._refused,
            empty=Trace(np.zeros(0), np.zeros((0, 3)), np.zeros(0, dtype=np.int64), tip),
        )
        self.seconds += spent.seconds
        return outcome

    def _refused(self, move: Move, why: str) -> None:
        what = f"{move.purpose} not executed: {why}"
        self.log.event("refused", {"what": what, "purpose": move.purpose, "path": move.path.tolist()})


def known_base(scene: Scene) -> Base | None:
    """The global model that the scene gives, None if it gives a region alone. Raises SceneError."""
    surface = scene.base_surface()
    return None if surface is None else Base(surface)


def discoverer(scene: Scene) -> Discover:
    """The procedure that finds an unknown body in the scene's region. Raises SceneError."""
    region = scene.model.region
    if region is None:
        raise SceneError(f"{scene.path}: model: give a mesh, or a region to look for the body in")
    return Discover(
        low=np.array(region.low),
        high=np.array(region.high),
        tip_radius=scene.tip.radius,
        smallest=scene.survey.smallest_feature,
        sides=scene.model.sides,
        speed=scene.survey.speed,
        force=scene.survey.force,
    )


def locator(scene: Scene, base: Base) -> Locate:
    """The procedure that finds where the object stands."""
    return Locate(
        base=base,
        tip_radius=scene.tip.radius,
        smallest=scene.survey.smallest_feature,
        shift=scene.model.shift,
        turn=scene.model.turn,
        speed=scene.survey.speed,
        force=scene.survey.force,
    )


def explorer(scene: Scene, base: Base, time_budget: float | None = None) -> Explore:
    """The exploratory procedure with the scene's settings; `time_budget` in s, None takes the scene's."""
    region = None if scene.model.region is None or scene.model.mesh is None else scene.model.region
    return Explore(
        base=base,
        tip_radius=scene.tip.radius,
        smallest=scene.survey.smallest_feature,
        precision=scene.explore.precision,
        time_budget=scene.explore.time_budget if time_budget is None else time_budget,
        region=None if region is None else (np.array(region.low), np.array(region.high)),
        speed=scene.survey.speed,
        force=scene.survey.force,
        false_alarms_per_metre=scene.detection.false_alarms_per_metre,
    )
