"""Feel along a line without knowing the body: approach until contact, follow it by its own slope, search again."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field, replace

import numpy as np

from hw import Move
from mapping import FloatArray, Trace
from planners.paths import PRESS

# In tip radii: of a guarded approach, of the first and the longest stretch that is followed at once
APPROACH_STRETCH, FIRST_STRETCH, LONGEST_STRETCH = 0.2, 1.0, 4.0
# A contact further from its prediction than this many tip radii makes the next stretch shorter
SURPRISE = 0.2
STEEPEST_SURFACE_SLOPE = 2.0


@dataclass
class Felt:
    """What was felt: `traces` of the sweeps in contact, and `empty` places.

    Where the ball met nothing: its place (3,), m, and the outward direction (3,) that it was pressed against, in rows
    (K, 6).
    """

    traces: list[Trace] = field(default_factory=list)
    empty: list[FloatArray] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class FeltLine:
    """A straight line over an unknown body, felt in stretches.

    Every approach comes down from free space by at most a tip radius at a time, so that a finger that reaches a
    tip radius beyond its commanded path meets the body before it runs into it.

    Args:
        start, stop: (3,) ends at the height where a ball in contact with the region's top would be, m.
        inward: (3,) unit direction in which the finger presses.
        depth: how far below that height the body may lie, m.
        tip_radius: m.
        speed, force: of the sweeps, m/s and N.
    """

    start: FloatArray
    stop: FloatArray
    inward: FloatArray
    depth: float
    tip_radius: float
    speed: float
    force: float

    def feel(self, felt: Felt) -> Generator[Move, Trace, None]:
        """Yield the sweeps; what they feel is added to `felt`."""
        place = 0.0
        while place < self._length - APPROACH_STRETCH * self.tip_radius:
            contact = yield from self._approach(place, felt)
            if contact is None:
                felt.empty.append(np.hstack([below := self._below(place), np.tile(-self.inward, (len(below), 1))]))
                place += 2.0 * self.tip_radius
            else:
                place = yield from self._follow(place, contact, felt)

    @property
    def _length(self) -> float:
        return float(np.linalg.norm(self.stop - self.start))

    @property
    def _ahead(self) -> FloatArray:
        return np.asarray((self.stop - self.start) / self._length)

    def _at(self, place: float, depth: float) -> FloatArray:
        return np.asarray(self.start + place * self._ahead + depth * self.inward)

    def _below(self, place: float) -> FloatArray:
        """Places (K, 3) of the ball under one of the line, as deep as the body may lie."""
        levels = np.linspace(0.0, self.depth, 2 + int(2.0 * self.depth / self.tip_radius))
        return self._at(place, 0.0) + levels[:, None] * self.inward

    def _approach(self, place: float, felt: Felt) -> Generator[Move, Trace, float | None]:
        """Depth of the first contact below the line at a place, found step by step; None if there is no body."""
        levels = np.arange(0.0, self.depth + self.tip_radius, self.tip_radius)
        for level in np.minimum(levels, self.depth):
            move = self._sweep(place, place + APPROACH_STRETCH * self.tip_radius, float(level), float(level))
            trace = yield move
            if len(trace):
                felt.traces.append(facing(trace, move))
                return float(np.median((trace.centers - self.start) @ self.inward))
        return None

    def _follow(self, place: float, depth: float, felt: Felt) -> Generator[Move, Trace, float]:
        """Follow the body from a contact until it is lost or the line ends; the place reached."""
        slope, stretch = 0.0, FIRST_STRETCH * self.tip_radius
        while place < self._length - 1e-9:
            onward = min(place + stretch, self._length)
            move = self._sweep(place, onward, depth, depth + slope * (onward - place))
            trace = yield move
            if len(trace):
                felt.traces.append(facing(trace, move))
            reached = place + self.tip_radius if len(trace) < 2 else self._reached(trace)
            if reached < onward - 0.5 * self.tip_radius or len(trace) < 2:
                # deeper than the sweep was commanded the body may go on
                share = (0.5 * (reached + onward) - place) / (onward - place)
                felt.empty.append(empty_at(move.path[0] + share * (move.path[-1] - move.path[0]), move))
                return max(reached, place) + 0.5 * self.tip_radius
            predicted = depth + slope * (onward - place)
            depth, slope = self._end(trace)
            surprised = abs(depth - predicted) > SURPRISE * self.tip_radius
            stretch = np.clip(
                stretch * (0.5 if surprised else 1.5),
                FIRST_STRETCH * self.tip_radius,
                LONGEST_STRETCH * self.tip_radius,
            )
            place = onward
        return self._length

    def _sweep(self, place: float, onward: float, depth: float, onward_depth: float) -> Move:
        press = PRESS * self.tip_radius
        path = np.stack([self._at(place, depth + press), self._at(onward, onward_depth + press)])
        return Move(path, self.inward, speed=self.speed, force=self.force)

    def _reached(self, trace: Trace) -> float:
        last = trace.centers[-max(1, len(trace) // 50) :].mean(axis=0)
        return float((last - self.start) @ self._ahead)

    def _end(self, trace: Trace) -> tuple[float, float]:
        """Depth of the body at the end of a trace, and its slope there, from its last half tip radius."""
        along, depth = (trace.centers - self.start) @ self._ahead, (trace.centers - self.start) @ self.inward
        last = along > along[-1] - 0.5 * self.tip_radius
        if last.sum() < 8 or np.ptp(along[last]) < 0.1 * self.tip_radius:
            return float(np.median(depth)), 0.0
        slope, level = np.polyfit(along[last] - along[-1], depth[last], 1)
        return float(level), float(np.clip(slope, -STEEPEST_SURFACE_SLOPE, STEEPEST_SURFACE_SLOPE))


def facing(trace: Trace, move: Move) -> Trace:
    """A trace that tells from which side its body was felt: if no contact normals were, against the approach."""
    if trace.has_contact_data:
        return trace
    outward = -np.atleast_2d(move.approach).mean(axis=0)
    return replace(trace, normals=np.tile(outward / np.linalg.norm(outward), (len(trace), 1)))


def empty_at(place: FloatArray, move: Move) -> FloatArray:
    """(1, 6) a place where a move met nothing, and the outward direction it pressed against."""
    outward = -np.atleast_2d(move.approach).mean(axis=0)
    return np.concatenate([place, outward / np.linalg.norm(outward)])[None]
