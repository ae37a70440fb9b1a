"""Travel: the ways through free space between moves, round the body where the straight way would run into it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hw import Move
from mapping import FloatArray, Trace
from mapping.base import Base
from planners import Outcome, Plan

# How far a finger backs off before it goes elsewhere, in tip radii (hw.probing.grbl_finger does the same)
BACK_OFF_DISTANCE = 0.5
# How far a ball may sink into the base on its way through free space, in tip radii
MOST_SINKING = 0.05
# Of the grid on which ways round the body are looked for, in tip radii; and its most nodes along an axis
GRID_SPACING, MOST_GRID_NODES = 0.75, 40
ROOM = 4.0


def gap(before: Move, after: Move, tip_radius: float) -> FloatArray:
    """The way between two moves (2, 3), m: backed off where the one ends, straight, and down where the other begins."""
    lift = BACK_OFF_DISTANCE * tip_radius
    return np.stack([before.path[-1] - lift * before.approach[-1], after.path[0] - lift * after.approach[0]])


def sunk(path: FloatArray, base: Base, tip_radius: float) -> float:
    """How deep a ball on a polyline (K, 3) sinks into the base at the deepest, m; 0 where it stays free."""
    return max(0.0, -float(base.foot(dense(path, 0.5 * tip_radius), tip_radius).height.min()))


def dense(path: FloatArray, spacing: float) -> FloatArray:
    """The polyline (K, 3) resampled at most `spacing` m apart."""
    if len(path) == 1:
        return path
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    s = np.linspace(0.0, along[-1], 2 + int(along[-1] / spacing))
    return np.column_stack([np.interp(s, along, path[:, k]) for k in range(3)])


def routed(plan: Plan, ways: Ways) -> Plan:
    """The plan with a travel move put before every move that cannot be reached straight from the one before it."""
    trace: Trace | None = None
    before: Move | None = None
    while True:
        try:
            move = next(plan) if trace is None else plan.send(trace)
        except StopIteration as end:
            return end.value if isinstance(end.value, Outcome) else Outcome("done")
        way = None if before is None else ways.round(before, move)
        if way is not None:
            yield way
        trace = yield move
        before = move


@dataclass(frozen=True, eq=False)
class Ways:
    """Finds ways round one body.

    Args:
        base: the body.
        tip_radius: m.
        low, high: (3,) corners of where the tip's centre may go, m.
        speed: of travel, m/s.
    """

    base: Base
    tip_radius: float
    low: FloatArray
    high: FloatArray
    speed: float

    def free(self, path: FloatArray) -> bool:
        """True if a ball on the polyline (K, 3) stays out of the body."""
        return sunk(path, self.base, self.tip_radius) <= MOST_SINKING * self.tip_radius

    def round(self, before: Move, after: Move) -> Move | None:
        """The travel between two moves; None where the straight way is free, or where no way was found."""
        straight = gap(before, after, self.tip_radius)
        if self.free(straight):
            return None
        first = self._out(straight[0], -before.approach[-1])
        last = self._out(straight[1], -after.approach[0])
        if first is None or last is None:
            return None
        between = self._between(first[-1], last[-1])
        if between is None:
            return None
        path = self._shortened(np.concatenate([first, between, last[::-1]]))
        return Move(path, -self.base.foot(path, self.tip_radius).normals, speed=self.speed, purpose="travel")

    def _out(self, start: FloatArray, away: FloatArray) -> FloatArray | None:
        """Straight away from the body until there is room: (2, 3), or None."""
        steps = start + np.linspace(0.0, 6.0 * self.tip_radius, 25)[:, None] * away
        inside = ((steps >= self.low) & (steps <= self.high)).all(axis=1)
        height = self.base.foot(steps, self.tip_radius).height
        roomy = np.flatnonzero((height >= self._room) & inside)
        if not len(roomy) or height[: roomy[0] + 1].min() < -MOST_SINKING * self.tip_radius:
            return None
        return np.stack([start, steps[roomy[0]]])

    @property
    def _room(self) -> float:
        """Height that a node of the grid must have so that the straight way to its neighbours is free, m."""
        return 0.9 * self._grid[1]

    @cached_property
    def _grid(self) -> tuple[list[FloatArray], float]:
        """Coordinates along each axis, and their largest spacing, m."""
        room = ROOM * self.tip_radius
        low = np.maximum(self.base.surface.bounds[0] - room, self.low)
        high = np.minimum(self.base.surface.bounds[1] + room, self.high)
        spacing = max(GRID_SPACING * self.tip_radius, float((high - low).max()) / MOST_GRID_NODES)
        axes = [np.linspace(a, b, max(2, 1 + int(np.ceil((b - a) / spacing)))) for a, b in zip(low, high, strict=True)]
        return axes, max(float(axis[1] - axis[0]) for axis in axes)

    @cached_property
    def _graph(self) -> tuple[FloatArray, Any]:
        """Free nodes (N, 3) of the grid and the lengths of the ways between neighbours."""
        from scipy.sparse import coo_matrix

        axes, _ = self._grid
        shape = tuple(len(axis) for axis in axes)
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        free = self.base.foot(nodes.reshape(-1, 3), self.tip_radius).height.reshape(shape) >= self._room
        number = np.where(free, np.cumsum(free).reshape(shape) - 1, -1)
        rows, columns = [], []
        for step in np.argwhere(np.ones((3, 3, 3))) - 1:
            if tuple(step) > (0, 0, 0):
                here = tuple(slice(max(0, -s), n - max(0, s)) for s, n in zip(step, shape, strict=True))
                there = tuple(slice(max(0, s), n + min(0, s)) for s, n in zip(step, shape, strict=True))
                both = free[here] & free[there]
                rows.append(number[here][both])
                columns.append(number[there][both])
        points, a, b = nodes[free], np.concatenate(rows), np.concatenate(columns)
        lengths = np.linalg.norm(points[a] - points[b], axis=1)
        return points, coo_matrix((lengths, (a, b)), shape=(len(points), len(points))).tocsr()

    def _between(self, start: FloatArray, stop: FloatArray) -> FloatArray | None:
        """Nodes (K, 3) of the shortest way over the grid, or None."""
        from scipy.sparse.csgraph import dijkstra

        points, graph = self._graph
        source, target = self._node(start), self._node(stop)
        if source is None or target is None:
            return None
        lengths, befores = dijkstra(graph, directed=False, indices=np.array([source]), return_predecessors=True)
        previous = befores[0]
        if not np.isfinite(lengths[0, target]):
            return None
        route = [target]
        while route[-1] != source:
            route.append(int(previous[route[-1]]))
        return np.asarray(points[route[::-1]])

    def _node(self, place: FloatArray) -> int | None:
        """The nearest node that can be reached straight, or None."""
        points, _ = self._graph
        order = np.argsort(np.linalg.norm(points - place, axis=1))[:24]
        return next((int(node) for node in order if self.free(np.stack([place, points[node]]))), None)

    def _shortened(self, path: FloatArray) -> FloatArray:
        """The path without the waypoints that a straight way can leave out."""
        kept, here = [0], 0
        while here < len(path) - 1:
            onward = len(path) - 1
            while onward > here + 1 and not self.free(path[[here, onward]]):
                onward -= 1
            kept.append(onward)
            here = onward
        return path[kept]
