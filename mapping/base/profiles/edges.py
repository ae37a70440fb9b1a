"""Edges of a profile between two of its levels: upright ones, and slanted ones as a ball feels their climb."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.base.profiles.jumps import SHORTEST_LEVEL
from mapping.geometry.templates import step_height

# A place is a parameter that only one cell in n fits: it costs twice what a height does (2 log n against log n). The
# run of a climb is one, too
EDGE_FREEDOM = 2
# What a profile comes back from within less of its length is a detail: the base is what most of it lies on
LONGEST_DETAIL = 0.5
# Rounds in which what the height itself moves aside settles: by the third it is off by the third power of the slope
SHEARED = 3
# Of the tip's radius: from so far beside a kink of the trace its slopes are those on either side, to the last digits
BESIDE_KINK = 1e-5


@dataclass(frozen=True)
class Edge:
    """Where a profile goes, for good, from one level to another.

    Args:
        index: its middle lies between the place of this number and the next.
        first, last: the numbers of the last place before it and, of a slanted one, of the last on its climb.
        place: of the middle of a slanted one along the profile, m.
        run: over which that climbs, m; 0: it is upright.
        height: by which a slanted one rises, m, signed: the ball's way over it is no multiple of that.
        slope: of the ground about a slanted one.
    """

    index: int
    first: int
    last: int
    place: float = 0.0
    run: float = 0.0
    height: float = 0.0
    slope: float = 0.0

    @classmethod
    def upright(cls, index: int) -> Edge:
        """The one between the place of that number and the next."""
        return cls(index, index, index)

    @property
    def freedom(self) -> int:
        """What its place, and the run of its climb, cost beside its height."""
        return EDGE_FREEDOM * (2 if self.run > 0.0 else 1)


def are_apart(edges: Sequence[Edge], count: int) -> bool:
    """True if all levels between edges of a profile of so many places are long enough."""
    ordered = sorted(edges, key=lambda edge: edge.index)
    between = [onward.first - edge.last for edge, onward in itertools.pairwise(ordered)]
    return min(between, default=count) >= SHORTEST_LEVEL * count


def returning(edges: Sequence[Edge], rises: FloatArray, within: float, count: int) -> list[Edge]:
    """Slanted ones among edges, in order, of which one leads off a level and the next one back to it.

    What they stand about is a detail, as long as it takes less than LONGEST_DETAIL of the profile.

    Args:
        edges: of a profile of so many places.
        rises: (E,) of each, m.
        within: heights that are no farther apart are the same, m.
    """
    back = list[Edge]()
    for k, (one, other) in enumerate(itertools.pairwise(edges)):
        slanted = [edge for edge in (one, other) if edge.run > 0.0]
        if other.last - one.first < LONGEST_DETAIL * count and abs(rises[k] + rises[k + 1]) < within:
            back += slanted
    return back


def climbed(edges: Sequence[Edge], x: FloatArray, tip_radius: float) -> FloatArray:
    """(N, E) columns that go from 0 before each edge to 1 beyond it, as a ball feels it that climbs a slanted one."""
    columns = (np.arange(len(x))[:, None] > np.array([edge.index for edge in edges], dtype=np.int64)).astype(np.float64)
    for k, edge in enumerate(edges):
        if edge.run > 0.0:
            columns[:, k] = felt_share(x - edge.place, edge.height, edge.run, edge.slope, tip_radius)
    return columns


@dataclass(frozen=True, eq=False)
class Slopes:
    """Climbs so wide that they are form: a part of the curve that a base follows.

    Args:
        edges: slanted ones.
        rises: (E,) by which each rises, m.
        tip_radius: of the ball, m.
    """

    edges: Sequence[Edge]
    rises: FloatArray
    tip_radius: float

    def __call__(self, x: FloatArray | float) -> FloatArray:
        """(N,) heights of the trace at places along it, m."""
        return np.reshape(climbed(self.edges, np.ravel(x), self.tip_radius) @ self.rises, np.shape(x))

    def sampled(self, x: FloatArray) -> FloatArray:
        """Places along the profile at which a line through the trace's own body bends: of those (N,) that are given,
        those that lie on no arc about an upper edge, the middles of such arcs, and both sides of each foot, m."""
        tiny = BESIDE_KINK * self.tip_radius
        for edge in self.edges:
            up, way = abs(edge.height), np.sign(edge.height)
            flank = np.hypot(edge.run, up)
            # on the lower side what is felt lies 0 higher, on the upper one the height: sheared by the ground's slope
            foot = (
                edge.place
                - way * (0.5 * edge.run + self.tip_radius * up / (flank + edge.run))
                - min(edge.height, 0.0) * edge.slope
            )
            top = edge.place + way * 0.5 * edge.run - max(edge.height, 0.0) * edge.slope
            arc = np.sort([top, top - way * self.tip_radius * up / flank])
            x = np.concatenate([x[(x < arc[0] - tiny) | (x > arc[1] + tiny)], [arc.mean(), foot - tiny, foot + tiny]])
        return np.unique(x)


def felt_share(away: FloatArray, height: float, run: float, slope: float, tip_radius: float) -> FloatArray:
    """(N,) share of a signed height at distances from the middle of a climb, m, that a ball feels there.

    Over ground of a slope m what is felt h higher lies m h aside in the ground's own frame: the frame of a profile with
    a step leans by the step.
    """
    up, share = abs(height), np.zeros_like(away)
    for _ in range(SHEARED):
        at = away + slope * height * share
        share = step_height(at, up, tip_radius, run) if height > 0.0 else up - step_height(-at, up, tip_radius, run)
        share = share / up
    return share
