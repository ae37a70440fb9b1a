"""Detour: out of a hollow with the stem as it stands, round the body's hull, and into the next place likewise."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mapping import BoolArray, FloatArray
from planners.paths.carrier import Carrier

# In tip radii: room beyond the hull that a place in the open has, and how far places on a way out lie apart
HULL_ROOM, LEAVING_SPACING = 1.1, 0.25
# Of the grid in the open, in tip radii; its most nodes along an axis, and how far beyond the hull it reaches
OPEN_SPACING, MOST_OPEN_NODES, OPEN_ROOM = 1.5, 24, 4.0
# Ways out that are looked at together, the shortest first
WAYS_AT_ONCE = 16
# Turns in place are looked at by so many steps
TURNING_STEPS = 8

# Places (K, 3) of the ball's centre, m, and approaches (K, 3)
Poses = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class Detour:
    """Ways for ball and stem that need no search among the body's parts.

    Outside of the planes that touch the body from all sides (its hull, nearly) a stem that points away from it is free
    wherever the ball goes. A way out of a hollow is straight: with the approach as it is in any direction, or turned in
    place and then drawn back along the stem.

    Args:
        carrier: the stem, and the body.
        low, high: (3,) corners of where the tip's centre may go, m.
    """

    carrier: Carrier
    low: FloatArray
    high: FloatArray

    def make_ready(self) -> None:
        """Make the roadmap in the open before the finger waits for it."""
        _ = self._graph

    def between(self, start: Poses, stop: Poses) -> Poses | None:
        """Poses from one (1, 3) to another (1, 3); None if one of them has no straight way out."""
        first, last = self.out(*(each[0] for each in start)), self.out(*(each[0] for each in stop))
        if first is None or last is None:
            return None
        around = self._around(first[0][-1], last[0][-1])
        if around is None:
            return None
        outward = -self.outward(around)
        path = np.concatenate([first[0], around, last[0][::-1]])
        return path, np.concatenate([first[1], outward, last[1][::-1]])

    def out(self, place: FloatArray, approach: FloatArray) -> Poses | None:
        """The shortest straight way of ball and stem into the open, its turns in place included; None if none is."""
        if self._open(place[None])[0]:
            return self._turned_outward(place[None], approach[None])
        # drawn back as it is, moved in any direction as it is, or turned in place and drawn back along the stem
        lattice, moved = self.carrier.lattice, 1 + len(self.carrier.lattice)
        ways = np.concatenate([-approach[None], lattice, -lattice])
        spacing = LEAVING_SPACING * self.carrier.tip_radius
        distance = self._distance_out(place, ways)
        last = np.ceil(np.where(np.isfinite(distance), distance, 0.0) / spacing).astype(np.int64)
        ended = place + spacing * last[:, None] * ways
        possible = np.isfinite(distance) & ((ended >= self.low) & (ended <= self.high)).all(axis=1)
        order = np.flatnonzero(possible)[np.argsort(last[possible], kind="stable")]
        # the shortest first, a few at once: most of the others need not be asked
        for some in np.split(order, np.arange(WAYS_AT_ONCE, len(order), WAYS_AT_ONCE)):
            number = np.arange(1 + int(last[some].max(initial=0)))
            centers, on_way = place + spacing * number[:, None] * ways[some][:, None], number <= last[some][:, None]
            approaches = np.where((some < moved)[:, None], approach, -ways[some])
            good = self._all(centers, on_way, None)
            turns = np.flatnonzero(good & (some >= moved))
            good[turns] = self._can_turn(place, approach, approaches[turns])
            good[good] = self._all(centers[good], on_way[good], approaches[good])
            for which in np.flatnonzero(good):
                path = centers[which, : last[some[which]] + 1]
                poses = path, np.tile(approaches[which], (len(path), 1))
                if some[which] >= moved:
                    turning = _turning(approach, approaches[which])
                    poses = (
                        np.concatenate([np.tile(place, (len(turning), 1)), path]),
                        np.concatenate([turning, poses[1]]),
                    )
                outside = self._turned_outward(*poses)
                if outside is not None:
                    return outside
        return None

    def outward(self, places: FloatArray) -> FloatArray:
        """(K, 3) unit directions away from the hull: the normals of its planes, those farthest behind a place first."""
        normals, offsets = self._planes
        beyond = places @ normals.T + offsets
        weight = np.exp((beyond - beyond.max(axis=1, keepdims=True)) / self.carrier.tip_radius)
        mean = weight @ normals
        return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))

    def _all(self, centers: FloatArray, on_way: BoolArray, approach: FloatArray | None) -> BoolArray:
        """(W,) True where the ball, or the stem behind it, is free all along the ways' places (W, S, 3)."""
        which, _ = np.nonzero(on_way)
        places = centers[on_way]
        carrier = self.carrier
        free = carrier.ball_is_free(places) if approach is None else carrier.is_free(places, approach[which])
        return np.asarray(np.bincount(which[~free], minlength=len(centers)) == 0)

    def _can_turn(self, place: FloatArray, approach: FloatArray, wanted: FloatArray) -> BoolArray:
        """(M,) True where the stem can be turned in place to an approach (M, 3)."""
        turning = [_turning(approach, each) for each in wanted]
        flat = np.concatenate([np.zeros((0, 3)), *turning])
        free = self.carrier.is_free(np.tile(place, (len(flat), 1)), flat)
        return np.asarray(free.reshape(len(wanted), TURNING_STEPS + 1).all(axis=1))

    def _turned_outward(self, path: FloatArray, approach: FloatArray) -> Poses | None:
        """The poses, and then the stem turned away from the hull in place; None if it touches the body there."""
        turning = _turning(approach[-1], -self.outward(path[-1:])[0])
        there = np.tile(path[-1], (len(turning), 1))
        if not self.carrier.is_free(there, turning).all():
            return None
        return np.concatenate([path, there]), np.concatenate([approach, turning])

    def _around(self, start: FloatArray, stop: FloatArray) -> FloatArray | None:
        """Places (K, 3) from one place in the open to another, no farther apart than half a tip radius."""
        from scipy.sparse.csgraph import dijkstra

        if self._open_way(start, stop):
            return self._dense(np.stack([start, stop]))
        nodes, graph = self._graph
        source, target = self._node(start), self._node(stop)
        if source is None or target is None:
            return None
        _, before = dijkstra(graph, directed=False, indices=np.array([source]), return_predecessors=True)
        route = [target]
        while route[-1] != source:
            if before[0, route[-1]] < 0:
                return None
            route.append(int(before[0, route[-1]]))
        path = np.concatenate([start[None], nodes[route[::-1]], stop[None]])
        kept = [0]
        while kept[-1] < len(path) - 1:
            onward = len(path) - 1
            while onward > kept[-1] + 1 and not self._open_way(path[kept[-1]], path[onward]):
                onward -= 1
            kept.append(onward)
        return self._dense(path[kept])

    def _dense(self, path: FloatArray) -> FloatArray:
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        count = np.maximum(1, np.ceil(steps / (0.5 * self.carrier.tip_radius)).astype(np.int64))
        place = np.append(np.concatenate([k + np.arange(n) / n for k, n in enumerate(count)]), float(len(steps)))
        return np.column_stack([np.interp(place, np.arange(len(path)), path[:, axis]) for axis in range(3)])

    def _open_way(self, start: FloatArray, stop: FloatArray) -> bool:
        return bool(self._open(self._dense(np.stack([start, stop]))).all())

    def _open(self, places: FloatArray) -> BoolArray:
        """(K,) True where a place lies beyond one of the hull's planes by enough."""
        return self._beyond(places) >= HULL_ROOM * self.carrier.tip_radius

    def _beyond(self, places: FloatArray) -> FloatArray:
        """(K,) how far a place lies beyond the hull's planes, the farthest one counting, m."""
        normals, offsets = self._planes
        return np.asarray((places @ normals.T + offsets).max(axis=1))

    def _distance_out(self, place: FloatArray, ways: FloatArray) -> FloatArray:
        """(W,) how far it is into the open along each way (W, 3), m; infinite along those that lead nowhere."""
        normals, offsets = self._planes
        missing, rate = HULL_ROOM * self.carrier.tip_radius - normals @ place - offsets, ways @ normals.T
        rising = rate > 1e-9
        return np.asarray(np.where(rising, missing / np.where(rising, rate, 1.0), np.inf).min(axis=1))

    def _node(self, place: FloatArray) -> int | None:
        nodes, _ = self._graph
        order = np.argsort(np.linalg.norm(nodes - place, axis=1))[:24]
        return next((int(node) for node in order if self._open_way(place, nodes[node])), None)

    @cached_property
    def _planes(self) -> tuple[FloatArray, FloatArray]:
        """Outward normals (H, 3) and offsets (H,) of the planes that touch the body, one for each of the lattice."""
        surface, normals = self.carrier.base.surface, self.carrier.lattice
        used = surface.vertices[np.unique(surface.faces)]
        return normals, -(used @ normals.T).max(axis=0)

    @cached_property
    def _graph(self) -> tuple[FloatArray, Any]:
        """Places (N, 3) of a grid in the open, and the lengths of the ways between neighbours."""
        from scipy.sparse import coo_matrix
        from scipy.spatial import cKDTree

        radius = self.carrier.tip_radius
        low = np.maximum(self.carrier.base.surface.bounds[0] - OPEN_ROOM * radius, self.low)
        high = np.minimum(self.carrier.base.surface.bounds[1] + OPEN_ROOM * radius, self.high)
        spacing = max(OPEN_SPACING * radius, float((high - low).max()) / MOST_OPEN_NODES)
        axes = [np.linspace(a, b, max(2, 1 + int(np.ceil((b - a) / spacing)))) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        beyond, open_from = self._beyond(grid), HULL_ROOM * radius
        nodes, beyond = grid[beyond >= open_from], beyond[beyond >= open_from]
        widest = np.sqrt(3.0) * max(float(axis[1] - axis[0]) for axis in axes)
        pairs = cKDTree(nodes).query_pairs(1.01 * widest, output_type="ndarray")
        lengths = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
        # a middle lies beyond by no less than an end does, but for the half way between them: few need be asked
        is_open = beyond[pairs].max(axis=1) - 0.5 * lengths >= open_from
        ask = np.flatnonzero(~is_open)
        is_open[ask] = self._open(0.5 * (nodes[pairs[ask, 0]] + nodes[pairs[ask, 1]]))
        pairs, lengths = pairs[is_open], lengths[is_open]
        return nodes, coo_matrix((lengths, (pairs[:, 0], pairs[:, 1])), shape=(len(nodes), len(nodes))).tocsr()


def _turning(start: FloatArray, stop: FloatArray) -> FloatArray:
    """(TURNING_STEPS + 1, 3) unit directions from one to another, evenly along the great circle."""
    across = stop - (stop @ start) * start
    length = np.linalg.norm(across)
    if length < 1e-9:
        across = np.cross(start, np.eye(3)[np.abs(start).argmin()])
        length = np.linalg.norm(across)
    turn = np.linspace(0.0, np.arccos(np.clip(start @ stop, -1.0, 1.0)), TURNING_STEPS + 1)[:, None]
    return np.asarray(np.cos(turn) * start + np.sin(turn) * across / length)
