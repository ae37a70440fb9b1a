"""Carrier: the straight stem behind the ball, and how an approach is turned so that it stays out of the body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from mapping import BoolArray, FloatArray
from mapping.base import Base
from planners.paths.felt_details import FeltDetails
from planners.paths.room import Room, room_about

# Where along its axis the stem is looked at, in tip radii: it begins where one half as thick leaves the ball's shadow,
# and a sharp edge between two places sinks at most 0.5 - sqrt(0.5^2 - 0.1875^2) = 0.037 into it (0.28 with places 0.9
# apart). Drawn back it is looked at in the same places: who finds that a place can be left may leave it
STEM_START, STEM_PLACES_APART = 1.5, 0.375
# How far a ball may sink into the base on its way through free space, in tip radii; a way that is planned keeps 0.02
# free of that even between places a quarter of a radius apart (0.25^2 / 8 = 0.008)
MOST_SINKING, FREE_SINKING = 0.05, 0.02
# Points of a Fibonacci lattice over the sphere: 162 lie about 16 degrees apart; an approach is turned to one of 642, 8
# degrees apart: half-way between two of them the end of a stem six radii long lies 6 (1 - cos 4 degrees) = 0.015 radii
# off either's way, where 16 degrees leave 0.06 and two such steps at once 0.2
LATTICE_DIRECTIONS, TURNED_DIRECTIONS = 162, 642
# How much turning between neighbouring waypoints costs against standing off the wanted direction
TURNING_COST = 4.0


@dataclass(frozen=True, eq=False)
class Carrier:
    """A straight round stem along the finger's axis.

    Args:
        base: the body it must stay out of.
        tip_radius: of the ball, m.
        radius, length: of the stem, m, measured from the ball's centre.
        backing: so far the ball must be able to draw back along the stem, m.
        backing_room: and so far off the body it must be then, m.
        felt: what is known to stand out of the body; None: nothing is.
    """

    base: Base
    tip_radius: float
    radius: float
    length: float
    backing: float = 0.0
    backing_room: float = 0.0
    felt: FeltDetails | None = None

    @classmethod
    def of(cls, base: Base, tip_radius: float, felt: FeltDetails | None = None) -> Carrier:
        """A stem half as thick as the ball and three balls long."""
        return cls(base, tip_radius, 0.5 * tip_radius, 6.0 * tip_radius, felt=felt)

    def height(self, places: FloatArray, radius: float) -> FloatArray:
        """(N,) how far balls of a radius (m) at places (N, 3) are off the body and what stands out of it, m.

        Exact where it is less than a tip radius.
        """
        height = self.base.foot(places, radius).height
        if self.felt is None:
            return height
        return np.minimum(height, self.felt.distance(places, radius + self.tip_radius) - radius)

    def clearance(self, path: FloatArray, approach: FloatArray) -> FloatArray:
        """(K,) distance of the stem's surface from the body at ball centres (K, 3) and approaches (K, 3), m.

        With `backing` that of the stem drawn back counts, too, and the room that the ball has there.

        No place is nearer to the body than the stem's middle by more than it lies from it: where that leaves a place
        free, the body is not asked, and a free stem's distance is this bound from below. In the open the middle tells
        of all places.
        """
        if self.length <= 0:
            return np.full(len(path), np.inf)
        back = self._back
        stem = path[:, None, :] - back[None, :, None] * approach[:, None, :]
        middle = len(back) // 2
        known = self.height(stem[:, middle], self.radius)
        height = known[:, None] - np.abs(back - back[middle])
        ask = height < 0
        ask[:, middle] = False
        height[ask] = self.height(stem[ask], self.radius)
        least = height.min(axis=1)
        if self.backing > 0:
            drawn = path - self.backing * approach
            ball = self.height(drawn, self.tip_radius) + FREE_SINKING * self.tip_radius - self.backing_room
            least = np.minimum(least, np.minimum(ball, replace(self, backing=0.0).clearance(drawn, approach)))
        return np.asarray(least)

    def is_free(self, path: FloatArray, approach: FloatArray) -> BoolArray:
        """(K,) True where the `clearance` is not negative.

        The stem's places are asked one after the other, of those that are still in question: what one of them shows to
        be blocked, or its distance to be free at others (no place is nearer by more than it lies off), is not asked.
        """
        free = np.ones(len(path), dtype=bool)
        if self.length <= 0:
            return free
        back = self._back
        left, bound = np.arange(len(path)), np.full((len(path), len(back)), -np.inf)
        if self.room is not None:
            stem = path[:, None, :] - back[:, None] * approach[:, None, :]
            least, most = (each.reshape(bound.shape) for each in self.room.bounds(stem.reshape(-1, 3)))
            bound[least >= self.radius] = 0.0
            free[(most < self.radius).any(axis=1)] = False
            left = np.flatnonzero(free)
            bound = bound[left]
        for k in _farthest_first(len(back)):
            which = np.flatnonzero(bound[:, k] < 0)
            if not len(which):
                continue
            height = self.base.foot(path[left[which]] - back[k] * approach[left[which]], self.radius).height
            bound[which] = np.maximum(bound[which], height[:, None] - np.abs(back - back[k]))
            blocked = which[height < 0]
            free[left[blocked]] = False
            if len(blocked):
                left, bound = np.delete(left, blocked), np.delete(bound, blocked, axis=0)
        if self.felt is not None and len(left):
            stem = path[left, None, :] - back[:, None] * approach[left, None, :]
            off = self.felt.distance(stem.reshape(-1, 3), self.radius).reshape(len(left), -1)
            free[left] = (off >= self.radius).all(axis=1)
        if self.backing > 0:
            left = np.flatnonzero(free)
            drawn = path[left] - self.backing * approach[left]
            free[left] = self.ball_is_free(drawn, self.backing_room - FREE_SINKING * self.tip_radius)
            left, drawn = left[free[left]], drawn[free[left]]
            free[left] = replace(self, backing=0.0).is_free(drawn, approach[left])
        return free

    @property
    def _back(self) -> FloatArray:
        """(S,) how far behind the ball's centre the stem is looked at, m."""
        begin, spacing = STEM_START * self.tip_radius, STEM_PLACES_APART * self.tip_radius
        return np.linspace(begin, self.length, max(2, 1 + int(np.ceil((self.length - begin) / spacing - 1e-9))))

    def ball_is_free(self, places: FloatArray, room: float | None = None) -> BoolArray:
        """(N,) True where a ball at the places (N, 3) is so far off the body (m); None: sinks no deeper into it than
        FREE_SINKING tip radii."""
        far = self.tip_radius + (-FREE_SINKING * self.tip_radius if room is None else room)
        if self.room is None:
            return self._clear(self.base.foot(places, far).height >= 0.0, places, far)
        least, most = self.room.bounds(places)
        free, ask = least >= far, np.flatnonzero((least < far) & (most >= far))
        free[ask] = self.base.foot(places[ask], far).height >= 0.0
        return self._clear(free, places, far)

    def _clear(self, free: BoolArray, places: FloatArray, far: float) -> BoolArray:
        """(N,) what is free of the body, and so far (m) off what stands out of it, too."""
        if self.felt is not None:
            ask = np.flatnonzero(free)
            free[ask] = self.felt.distance(places[ask], far) >= far
        return free

    def turned(self, path: FloatArray, approach: FloatArray, most: float, may: BoolArray | None = None) -> FloatArray:
        """The approaches (K, 3), turned where the stem would touch the body, as little and as evenly as will do.

        The course of least cost through the directions that are free at each waypoint (Viterbi); where none within
        `most` rad of the wanted one is free, the wanted one stays.

        Args:
            path: (K, 3) centres of the ball, m.
            approach: (K, 3) unit directions that are wanted.
            most: rad.
            may: (K,) waypoints whose approach may be turned; None: all.
        """
        offends = ~self.is_free(path, approach)
        if may is not None:
            offends &= may
        if not offends.any():
            return approach
        fine = spread_evenly(TURNED_DIRECTIONS)
        lattice = np.broadcast_to(fine, (len(path), *fine.shape))
        choices = np.concatenate([approach[:, None], lattice], axis=1)
        angle = np.arccos(np.clip(np.einsum("kij,kj->ki", choices, approach), -1.0, 1.0))
        allowed = (angle <= most) & offends[:, None]
        where, which = np.nonzero(allowed)
        free = self.is_free(path[where], choices[where, which])
        cost = np.full(angle.shape, np.inf)
        cost[where[free], which[free]] = angle[where[free], which[free]] ** 2
        stuck = ~np.isfinite(cost).any(axis=1)
        cost[stuck | ~offends, 0] = 0.0
        return np.asarray(choices[np.arange(len(path)), _course(cost, choices)])

    @cached_property
    def room(self) -> Room | None:
        """What is known beforehand of how far places are from the body."""
        return room_about(self.base)

    @cached_property
    def lattice(self) -> FloatArray:
        """(M, 3) unit vectors spread evenly over the sphere."""
        return spread_evenly(LATTICE_DIRECTIONS)


@lru_cache
def _farthest_first(count: int) -> tuple[int, ...]:
    """The numbers below a count, from the middle on, each as far as can be from those before it."""
    order = [count // 2]
    while len(order) < count:
        off = np.abs(np.arange(count)[:, None] - order).min(axis=1)
        order.append(int(off.argmax()))
    return tuple(order)


def _course(cost: FloatArray, choices: FloatArray) -> list[int]:
    """Which choice (K,) at every waypoint, of the least sum of costs (K, M) and of squared turns between them."""
    total, came = cost[0], []
    for k in range(1, len(cost)):
        into, out_of = np.flatnonzero(np.isfinite(cost[k])), np.flatnonzero(np.isfinite(total))
        apart = np.arccos(np.clip(choices[k - 1, out_of] @ choices[k, into].T, -1.0, 1.0))
        sums = total[out_of, None] + TURNING_COST * apart**2
        step = np.zeros(len(total), dtype=np.int64)
        step[into] = out_of[sums.argmin(axis=0)]
        total = np.full(len(total), np.inf)
        total[into] = sums.min(axis=0) + cost[k, into]
        came.append(step)
    route = [int(total.argmin())]
    for step in reversed(came):
        route.append(int(step[route[-1]]))
    return route[::-1]


def spread_evenly(count: int) -> FloatArray:
    """(count, 3) unit vectors spread evenly over the sphere."""
    number = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * number / count, np.pi * (1.0 + np.sqrt(5.0)) * number
    flat = np.sqrt(1.0 - z**2)
    return np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
