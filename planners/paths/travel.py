"""Travel: the ways through free space between moves, round the body where the straight way would run into it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from hw import THROUGH_SPACE, Move
from mapping import BoolArray, FloatArray, IntArray, Trace
from mapping.base import Base
from mapping.detection import face_samples
from planners import Outcome, Parted, Plan, Refused
from planners.paths.carrier import FREE_SINKING, MOST_SINKING, Carrier
from planners.paths.detour import Detour
from planners.paths.felt_details import DETAIL_ROOM, FeltDetails
from planners.paths.room import room_about
from planners.paths.sound import BACK_OFF_DISTANCE, beside, can_be_left, resampled, resting_at_its_ends, sound_parts

# Places of a way lie at most so far apart where it is looked whether it is free, in tip radii
FREE_SPACING = 0.25
# About its ends a way need not keep off the body: the finger was or will be there, in tip radii
ENDS = 1.0
# Of the grid on which ways round the body are looked for, in tip radii; and its most nodes along an axis
GRID_SPACING, MOST_GRID_NODES = 0.75, 40
ROOM = 4.0
# How far out of a narrow place a straight way is looked for, in tip radii
OUT_DISTANCE = 6.0
# Places off the surface where the grid is too coarse: how high over contact, in tip radii; how many of each at most;
# and how many neighbours of each are tried
NEAR_LIFTS = (0.2, 0.5)
MOST_NEAR_PLACES, NEAR_NEIGHBOURS = 2000, 10
# Waypoints that are asked at once whether they can be reached straight: of speed alone, the ways are the same
STRAIGHT_AT_ONCE = 8
# Samples whose mean tells where a sweep ended: to 8^-1/2 = 0.35 of their noise
LAST_SAMPLES = 8
# Nodes about a place that may be reached straight, the nearest of all
NODES_TRIED = 24
# Where along a way it is looked whether there is room, the middle first: what is blocked there needs no second look
WAY_SHARES = (0.5, 0.25, 0.75, 0.125, 0.875, 0.375, 0.625)

# A sheet whose mean normal is longer than this, all of it within 60 degrees of one direction, needs no ways round it
ONE_SIDED = 0.5
# A plan that asks so often for what was refused does nothing else: the driver is asked again, and ends it
MOST_SPARED = 20


def gap(before: Move, after: Move, tip_radius: float) -> FloatArray:
    """The way between two moves (2, 3), m: backed off where the one ends, straight, and down where the other begins.

    Travel begins and ends in free space, where nothing is to back off from.
    """
    first, last = (0.0 if move.purpose in THROUGH_SPACE else BACK_OFF_DISTANCE * tip_radius for move in (before, after))
    return np.stack([before.path[-1] - first * before.approach[-1], after.path[0] - last * after.approach[0]])


def sunk(path: FloatArray, carrier: Carrier) -> float:
    """How deep a ball on a polyline (K, 3) may sink into the body at the deepest, m; 0 where it stays free.

    It is looked at every FREE_SPACING tip radii: round an edge it may sink FREE_SPACING^2 / 8 of them deeper between.
    """
    tip_radius = carrier.tip_radius
    lowest = float(carrier.height(dense(path, FREE_SPACING * tip_radius), tip_radius).min())
    return max(0.0, FREE_SPACING**2 / 8.0 * tip_radius - lowest) if lowest < 0.0 else 0.0


def dense(path: FloatArray, spacing: float) -> FloatArray:
    """The polyline (K, 3) resampled at most `spacing` m apart."""
    if len(path) == 1:
        return path
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    s = np.linspace(0.0, along[-1], 2 + int(along[-1] / spacing))
    return np.column_stack([np.interp(s, along, path[:, k]) for k in range(3)])


def routed(plan: Plan, ways: Ways, check: Callable[[Move], str | None] | None = None) -> Plan:
    """The plan with travel put before every move that cannot be reached straight, and sweeps split where they offend.

    Of a sweep that ran into something nobody knew what leads up to that and what leads on is made.
    What was made is learnt from what the driver sends back: after a planners.Refused the finger still stands where
    the last executed move ended. The plan is sent a planners.Parted for a move that was made in parts or after travel.
    What was refused is not asked again, in neither direction, until another move was made: nothing has changed, and
    the plan is sent the same answer.

    Args:
        check: what is wrong with a move, wherever it begins, or None; only a sweep with something wrong, or that the
            finger could not leave, is split.
    """
    answer: Trace | None = None
    before: Move | None = None
    refused, spared = list[tuple[Move, Refused]](), 0
    while True:
        try:
            move = next(plan) if answer is None else plan.send(answer)
        except StopIteration as end:
            return end.value if isinstance(end.value, Outcome) else Outcome("done")
        again = next((said for asked, said in refused if _same_way(asked, move)), None)
        if again is not None and spared < MOST_SPARED:
            answer, spared = again, spared + 1
            continue
        parts = [move]
        if check is not None and move.purpose == "sweep" and (check(move) or not can_be_left(move, ways.carrier)):
            parts = sound_parts(move, ways.carrier) or [move]
        if check is not None and move.purpose == "sweep":
            parts = [resting_at_its_ends(part, ways.carrier) for part in parts]
        felt, made, waiting = [], [], deque(parts)
        while waiting:
            part = waiting.popleft()
            answer, travelled, done = yield from _reached(part, before, ways)
            before = _as_felt(done, answer, ways.carrier) if done is not None else travelled or before
            if ways.felt is not None:
                ways.felt.learn(answer, part.speed)
            if done is not None:
                felt.append(answer)
                made.extend([done] if travelled is None else [travelled, done])
            elif check is not None and isinstance(answer, Refused) and answer.touching is not None:
                waiting.extendleft(reversed(beside(part, answer.touching, ways.carrier)))
        if made and made != [move]:
            answer = Parted.of(felt, made)
        if made:
            refused, spared = [], 0
        elif isinstance(answer, Refused):
            refused.append((move, answer))


def _same_way(one: Move, other: Move) -> bool:
    """True if a move is another one, or that backwards."""
    if one.purpose != other.purpose or one.path.shape != other.path.shape:
        return False
    return any(
        np.array_equal(one.path[::turn], other.path) and np.array_equal(one.approach[::turn], other.approach)
        for turn in (1, -1)
    )


def _as_felt(move: Move, felt: Trace, carrier: Carrier) -> Move:
    """A sweep that ends where the ball was felt to rest, if that lies farther out: from there a finger backs off."""
    if move.purpose != "sweep" or not len(felt):
        return move
    end, back = move.path[-1], -move.approach[-1]
    off = felt.centers[-LAST_SAMPLES:].mean(axis=0) - end
    lift = float(off @ back)
    if lift <= 0.0 or np.linalg.norm(off - lift * back) > FREE_SPACING * felt.tip_radius:  # it left the body before
        return move
    rested = replace(move, path=np.concatenate([move.path[:-1], (end + lift * back)[None]]))
    return rested if can_be_left(rested, carrier) else move


def _reached(
    move: Move, before: Move | None, ways: Ways
) -> Generator[Move, Trace, tuple[Trace, Move | None, Move | None]]:
    """Make a move after the travel to it; what it felt, and the travel and the move if they were executed."""
    way = None if before is None else ways.round(before, move)
    if way is not None:
        answer = yield way
        if isinstance(answer, Refused):
            return answer, None, None
    answer = yield move
    return answer, way, None if isinstance(answer, Refused) else move


def way_between(before: Move, after: Move, tip_radius: float) -> tuple[FloatArray, FloatArray]:
    """The straight way between two moves: centres (K, 3), m, and the approach (K, 3) that turns evenly along it."""
    ends = np.stack([before.approach[-1], after.approach[0]])
    return resampled(gap(before, after, tip_radius), ends, 0.5 * tip_radius)


@dataclass(frozen=True, eq=False)
class Ways:
    """Finds ways round one body.

    Args:
        base: the body.
        tip_radius: m.
        low, high: (3,) corners of where the tip's centre may go, m.
        speed: of travel, m/s.
        felt: what is known to stand out of the body; what the sweeps feel is added to it. None: nothing is kept.

    The ways are the shortest over a roadmap of free space: a grid where there is room, and places off the surface
    where the ball fits but the grid is too coarse (Kavraki et al., Probabilistic roadmaps, 1996, with places that
    are not drawn at random).
    """

    base: Base
    tip_radius: float
    low: FloatArray
    high: FloatArray
    speed: float
    felt: FeltDetails | None = None

    def make_ready(self) -> None:
        """Make what would keep the finger waiting: roadmaps, for a body that is to be felt from more than one side."""
        from planners.paths.roadmap_kernels import shortest_way

        starts = np.zeros(2, dtype=np.int32)
        shortest_way(starts, starts[:0], np.zeros(0), np.zeros((1, 3)), 0, 0)  # compiled
        areas = self.base.surface.face_areas
        if np.linalg.norm(areas @ self.base.surface.face_normals) < ONE_SIDED * areas.sum():
            _ = self._graph
            if (room := room_about(self.base)) is not None:
                room.bounds(np.zeros((1, 3)))  # compiled, too
            for detour in (self._detour, self._bare_detour):
                detour.make_ready()

    def free(self, path: FloatArray, room: float = 0.0) -> bool:
        """True if a ball on the polyline (K, 3) stays out of the body, so far off it as `room` (m) says."""
        return bool(self.carrier.ball_is_free(dense(path, FREE_SPACING * self.tip_radius), room or None).all())

    @cached_property
    def carrier(self) -> Carrier:
        """The stem behind the ball."""
        return Carrier.of(self.base, self.tip_radius, self.felt)

    def round(self, before: Move, after: Move) -> Move | None:
        """The travel between two moves; None where the straight way is free, or where no way was found.

        What is not known yet may stand out of the body: a way keeps off it where one can.
        """
        straight = way_between(before, after, self.tip_radius)
        nodes, near = None, None
        for room in (DETAIL_ROOM * self.tip_radius, 0.0):
            if self._sound(*straight, room):
                return None
            nodes = self._over_roadmap(before, after) if nodes is None else nodes
            near = self._near(before, after, nodes, room) if len(nodes) else None
            if near is not None and self._sound(near.path, near.approach, room):
                return near
            far = self._far(before, after, room)
            if far is not None and self._sound(far.path, far.approach, room):
                return far
        return near

    def _over_roadmap(self, before: Move, after: Move) -> FloatArray:
        """Waypoints (K, 3) of the ball's shortest way between two moves over the roadmap; none if there is none."""
        begin, stop = gap(before, after, self.tip_radius)
        first, last = self._out(begin, -before.approach[-1]), self._out(stop, -after.approach[0])
        between = self._between(first[-1], last[-1])
        return np.zeros((0, 3)) if between is None else np.concatenate([first, between, last[::-1]])

    def _near(self, before: Move, after: Move, nodes: FloatArray, room: float) -> Move:
        """The way of the ball along waypoints (K, 3) between two moves, shortened, the stem turned as it goes."""
        begun, ended = before.approach[-1], after.approach[0]
        path = dense(self._shortened(nodes, room), self.tip_radius)
        wanted = -self.base.foot(path, self.tip_radius).normals
        wanted[0], wanted[-1] = begun, ended
        approach = replace(self.carrier, radius=self.carrier.radius + room).turned(path, wanted, np.pi)
        return Move(path, approach, speed=self.speed, purpose="travel")

    def _far(self, before: Move, after: Move, room: float) -> Move | None:
        """The way round the hull; from where the move before began, if only there a way leads out. None if none is."""
        begin, stop = gap(before, after, self.tip_radius)
        detour = self._detour if room > 0 else self._bare_detour
        poses = detour.between((begin[None], before.approach[-1:]), (stop[None], after.approach[:1]))
        if poses is None:
            lift = 0.0 if before.purpose in THROUGH_SPACE else BACK_OFF_DISTANCE * self.tip_radius
            back = (before.path - lift * before.approach)[::-1], before.approach[::-1]
            poses = detour.between((back[0][-1:], back[1][-1:]), (stop[None], after.approach[:1]))
            poses = poses and (np.concatenate([back[0], poses[0]]), np.concatenate([back[1], poses[1]]))
        return None if poses is None else Move(*poses, speed=self.speed, purpose="travel")

    def _sound(self, path: FloatArray, approach: FloatArray, room: float) -> bool:
        """True if ball and stem stay free on a way (K, 3), and so far off the body (m) but for its ends."""
        path, approach = resampled(path, approach, FREE_SPACING * self.tip_radius)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        inner = np.minimum(along, along[-1] - along) > ENDS * self.tip_radius
        roomy = replace(self.carrier, radius=self.carrier.radius + room)
        return bool(
            self.carrier.ball_is_free(path[~inner]).all()
            and self.carrier.ball_is_free(path[inner], room - FREE_SINKING * self.tip_radius).all()
            and self.carrier.is_free(path[~inner], approach[~inner]).all()
            and roomy.is_free(path[inner], approach[inner]).all()
        )

    @cached_property
    def _detour(self) -> Detour:
        room = DETAIL_ROOM * self.tip_radius
        carrier = replace(self.carrier, tip_radius=self.tip_radius + room, radius=self.carrier.radius + room)
        return Detour(carrier, self.low, self.high)

    @cached_property
    def _bare_detour(self) -> Detour:
        return Detour(self.carrier, self.low, self.high)

    def _out(self, start: FloatArray, away: FloatArray) -> FloatArray:
        """Where there is room, by the shortest straight way, that along the approach first: (2, 3); (1, 3) if none is.

        In an inner corner the way along one wall's normal stays beside the other wall: the way out is sideways.
        """
        along = np.linspace(0.0, OUT_DISTANCE * self.tip_radius, 25)
        for directions in (away[None], self.carrier.lattice):
            steps = start + along[:, None] * directions[:, None, :]
            inside = ((steps >= self.low) & (steps <= self.high)).all(axis=2)
            height = self.carrier.height(steps.reshape(-1, 3), self.tip_radius).reshape(inside.shape)
            roomy = (height >= self._room) & inside
            sinks = np.minimum.accumulate(height, axis=1) < -MOST_SINKING * self.tip_radius
            step = np.where((roomy & ~sinks).any(axis=1), (roomy & ~sinks).argmax(axis=1), len(along))
            if step.min() < len(along):
                return np.stack([start, steps[step.argmin(), step.min()]])
        return start[None]

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
        height = self.base.foot(nodes.reshape(-1, 3), self.tip_radius).height.reshape(shape)
        free = height >= self._room
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
        near = self._near_surface(points, height[free])
        points, a, b = np.concatenate([points, near[0]]), np.append(a, near[1]), np.append(b, near[2])
        lengths = np.linalg.norm(points[a] - points[b], axis=1)
        one_way = coo_matrix((lengths, (a, b)), shape=(len(points), len(points))).tocsr()
        # to both sides: a search over an undirected graph would turn it round anew for every way
        graph = one_way.maximum(one_way.T).tocsr()
        return points, graph

    def _near_surface(self, grid: FloatArray, heights: FloatArray) -> tuple[FloatArray, IntArray, IntArray]:
        """Free places (M, 3) off the surface that the grid's nodes (N, 3) are too coarse for, and the ways to others.

        The nodes stand (N,) so high over the body, m. Ways are pairs of numbers, the grid's nodes being counted first.
        """
        from scipy.spatial import cKDTree

        surface = self.base.surface
        spacing = max(self.tip_radius, float(np.sqrt(surface.face_areas.sum() / MOST_NEAR_PLACES)))
        samples = face_samples(surface, spacing)
        on, face = samples.points, samples.owner
        # of long faces, and small ones, samples lie closer: one for each cell half as wide, and side of the body
        cells = np.column_stack([np.floor(2.0 * on / spacing), np.rint(surface.face_normals[face])])
        one = np.sort(np.unique(cells, axis=0, return_index=True)[1])
        on, face = on[one], face[one]
        places = [on + (1.0 + lift) * self.tip_radius * surface.face_normals[face] for lift in NEAR_LIFTS]
        near = np.concatenate(places)
        inside = ((near >= self.low) & (near <= self.high)).all(axis=1)
        height = self.base.foot(near, self.tip_radius).height
        # where there is room the grid has nodes of its own
        kept = inside & (height > 0.0) & (height < self._room)
        near, heights = near[kept], np.concatenate([heights, height[kept]])
        points = np.concatenate([grid, near])
        if not len(near):
            return near, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        count = min(NEAR_NEIGHBOURS + 1, len(points))
        _, other = cKDTree(points).query(near, k=count)
        a = np.repeat(np.arange(len(near)) + len(grid), count)
        b = other.reshape(-1)
        a, b = a[a != b], b[a != b]
        # most ways are found from both ends: each is looked at once
        _, first, same = np.unique(
            np.minimum(a, b) * len(points) + np.maximum(a, b), return_index=True, return_inverse=True
        )
        ends = a[first], b[first]
        free = self._free_ways(*(points[end] for end in ends), *(heights[end] for end in ends))[same]
        return near, a[free], b[free]

    def _free_ways(self, starts: FloatArray, stops: FloatArray, first: FloatArray, last: FloatArray) -> BoolArray:
        """(W,) which straight ways have room for the ball at seven places between their ends (W, 3).

        The ends stand (W,) so high over the body, m: no place on a way is nearer to it by more than it lies off them.
        """
        free, length = np.arange(len(starts)), np.linalg.norm(stops - starts, axis=1)
        for share in WAY_SHARES:
            known = np.maximum(first - share * length, last - (1 - share) * length)[free] >= 0.0
            ask = free[~known]
            between = (1 - share) * starts[ask] + share * stops[ask]
            blocked = ask[self.base.foot(between, self.tip_radius).height < 0.0]
            free = np.setdiff1d(free, blocked, assume_unique=True)
        mask = np.zeros(len(starts), dtype=bool)
        mask[free] = True
        return mask

    def _between(self, start: FloatArray, stop: FloatArray) -> FloatArray | None:
        """Nodes (K, 3) of the shortest way over the grid, or None."""
        from planners.paths.roadmap_kernels import shortest_way

        points, graph = self._graph
        source, target = self._node(start), self._node(stop)
        if source is None or target is None:
            return None
        way = shortest_way(graph.indptr, graph.indices, graph.data, points, source, target)
        return np.asarray(points[way]) if len(way) else None

    def _node(self, place: FloatArray) -> int | None:
        """The nearest node that can be reached straight, or None."""
        points, _ = self._graph
        distance = np.linalg.norm(points - place, axis=1)
        near = (
            np.argpartition(distance, NODES_TRIED)[:NODES_TRIED]
            if len(points) > NODES_TRIED
            else np.arange(len(points))
        )
        order = near[np.argsort(distance[near])]
        return next((int(node) for node in order if self.free(np.stack([place, points[node]]))), None)

    def _shortened(self, path: FloatArray, room: float) -> FloatArray:
        """The path without the waypoints that a straight way can leave out."""
        kept = [0]
        while kept[-1] < len(path) - 1:
            kept.append(self._farthest(path, kept[-1], room))
        return path[kept]

    def _farthest(self, path: FloatArray, here: int, room: float) -> int:
        """The farthest waypoint that can be reached straight from one of them; the next one if none can."""
        beyond = np.arange(len(path) - 1, here + 1, -1)
        # a few at once: asking for each by itself takes longer than the asking
        for some in np.split(beyond, np.arange(STRAIGHT_AT_ONCE, len(beyond), STRAIGHT_AT_ONCE)):
            ways = [dense(path[[here, onward]], FREE_SPACING * self.tip_radius) for onward in some]
            free = self.carrier.ball_is_free(np.concatenate([np.zeros((0, 3)), *ways]), room or None)
            starts = np.cumsum([0, *(len(way) for way in ways)])
            for onward, start, stop in zip(some, starts[:-1], starts[1:], strict=True):
                if free[start:stop].all():
                    return int(onward)
        return here + 1
