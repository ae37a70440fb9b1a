"""Checks of a move before it moves anything: workspace, speed, force, approach angle, collision."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hw import Move, Workspace
from mapping import FloatArray, length_text
from mapping.base import Base
from planners.paths.carrier import FREE_SINKING, MOST_SINKING, Carrier
from planners.paths.felt_details import FeltDetails
from planners.paths.sound import FIELD, PRESSED, held_up, resampled
from planners.paths.travel import gap, sunk, way_between

# Places along a move are so close together where the stem is asked, in tip radii: half of a sweep's waypoints' spacing,
# for between two of them the stem turns
STEM_LOOKED_AT = 0.1


@dataclass(frozen=True, eq=False)
class Limits:
    """What a move must keep to.

    Args:
        workspace: of the finger.
        base: the global model; None while it is unknown: then only the workspace, speed and force are checked.
        tip_radius: m.
        field: largest angle between the finger's axis and the base's normal in a sweep, rad.
        stem_radius: of the straight stem behind the ball, m.
        stem_length: of the stem that is checked, m.
        felt: what is known to stand out of the model; None: nothing is.
    """

    workspace: Workspace
    base: Base | None
    tip_radius: float
    field: float = FIELD
    stem_radius: float = 0.0
    stem_length: float = 0.0
    felt: FeltDetails | None = None

    @classmethod
    def of(cls, workspace: Workspace, base: Base | None, tip_radius: float, felt: FeltDetails | None = None) -> Limits:
        """Limits with a stem half as thick as the ball and three balls long."""
        return cls(workspace, base, tip_radius, stem_radius=0.5 * tip_radius, stem_length=6.0 * tip_radius, felt=felt)

    def violation(self, move: Move, before: Move | None = None) -> str | None:
        """What is wrong with the move, and the way to it from the one before it, as a sentence; None if nothing is."""
        if not self._last or self._last[-1][0] is not move:
            self._last[:] = [(move, self._wrong(move))]
        wrong = self._last[-1][1]
        if wrong or before is None or self.base is None:
            return wrong
        return self._way(before, move, self.base)

    @cached_property
    def _last(self) -> list[tuple[Move, str | None]]:
        """The last move that was looked at, and what is wrong with it: router and driver ask for one in turn."""
        return []

    def _wrong(self, move: Move) -> str | None:
        """What is wrong with the move itself, wherever it begins."""
        complaint = self._workspace(move) or self._speed(move)
        if complaint or self.base is None:
            return complaint
        return self._field(move, self.base) or self._collision(move, self.base) or self._stem(move, self.base)

    def _workspace(self, move: Move) -> str | None:
        outside = ((move.path < self.workspace.low) | (move.path > self.workspace.high)).any(axis=1)
        if not outside.any():
            return None
        where = np.round(move.path[outside.argmax()], 6).tolist()
        low, high = (np.round(bound, 6).tolist() for bound in (self.workspace.low, self.workspace.high))
        return f"the path leaves the workspace at {where} m; possible are {low} to {high} m"

    def _speed(self, move: Move) -> str | None:
        if move.speed > self.workspace.max_speed:
            return f"the speed is {move.speed:g} m/s; at most {self.workspace.max_speed:g} m/s is possible"
        if move.force > self.workspace.max_force:
            return f"the force is {move.force:g} N; at most {self.workspace.max_force:g} N is possible"
        return None

    def _field(self, move: Move, base: Base) -> str | None:
        if move.purpose != "sweep":
            return None
        feet = base.foot(move.path, self.tip_radius)
        outward = feet.normals * np.where(feet.height > -self.tip_radius, 1.0, -1.0)[:, None]
        angle = np.arccos(np.clip(-(outward * move.approach).sum(axis=1), -1.0, 1.0))
        if angle.max() <= self.field:
            return None
        return (
            f"the finger's axis is {np.degrees(angle.max()):.0f} degrees off the surface's normal; "
            f"the sensor's field is {np.degrees(self.field):.0f} degrees"
        )

    def _collision(self, move: Move, base: Base) -> str | None:
        """The ball: a sweep presses a little, any other move stays free."""
        if move.purpose == "sweep":
            path, approach = move.path, move.approach
            if len(path) > 1:
                path, approach = resampled(path, approach, 0.5 * self.tip_radius)
            highest = float(held_up(path, approach, base, self.tip_radius).max())
            if highest <= PRESSED * self.tip_radius:
                return None
            return f"another part of the body is in the sweep's way and holds the ball up by {length_text(highest)}"
        deepest = sunk(move.path, self._carrier(base))
        if deepest <= MOST_SINKING * self.tip_radius:
            return None
        return f"the way through free space sinks {length_text(deepest)} into the body"

    def _stem(self, move: Move, base: Base) -> str | None:
        path, approach = move.path, move.approach
        if len(path) > 1:
            path, approach = resampled(path, approach, STEM_LOOKED_AT * self.tip_radius)
        return self._stem_sinks("the stem behind the ball", path, approach, base)

    def _stem_sinks(self, what: str, path: FloatArray, approach: FloatArray, base: Base) -> str | None:
        carrier = self._carrier(base)
        allowed = FREE_SINKING * self.tip_radius
        if replace(carrier, radius=self.stem_radius - allowed).is_free(path, approach).all():
            return None
        clearance = float(carrier.clearance(path, approach).min())
        return f"{what} sinks {length_text(-clearance)} into the body" if clearance < -allowed else None

    def _carrier(self, base: Base) -> Carrier:
        return Carrier(base, self.tip_radius, self.stem_radius, self.stem_length, felt=self.felt)

    def _way(self, before: Move, move: Move, base: Base) -> str | None:
        """Ball and stem on their way from the end of one move to the beginning of the next, as the model has it.

        A finger backs off from where it was felt to rest, which details make farther out than it was commanded to.
        """
        deepest = sunk(gap(before, move, self.tip_radius), replace(self._carrier(base), felt=None))
        if deepest > MOST_SINKING * self.tip_radius:
            return f"the way from the move before sinks {length_text(deepest)} into the body"
        way = way_between(before, move, self.tip_radius)
        return self._stem_sinks("on the way from the move before the stem", *way, base)
