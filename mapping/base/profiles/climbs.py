"""Climbs: where a profile may rise from one level to another over a run, and whether that pays for itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.base.profiles.edges import EDGE_FREEDOM, Edge, felt_share
from mapping.base.profiles.evidence import Scatter
from mapping.base.profiles.jumps import MOST_JUMPS, SHORTEST_LEVEL, rises
from mapping.instrument import CONTACT_ROUNDING, FEATURE_RESIDUAL_SDS, neighbour_scatter

# Share of a profile over which differences tell of a climb: twice the shortest level. Of one that takes more of it most
# differences are a part, and none stands out; that is sought in the whole profile
LONGEST_TOLD = 2 * SHORTEST_LEVEL
# Samples that a climb is fitted to, at most: 24 simulated ramps keep their runs to within a hundredth
CLIMB_SAMPLES = 400
# Runs, and places for each, of which the best begins the search for a climb that a stretch holds. With six runs, each a
# half of the last, at nine places 5 of 48 simulated ramps were missed, now none
CLIMBS_TRIED = 12
# Places of an upright edge that are tried over twice the run of a slanted one. Of 24 simulated upright steps one, a
# wall that the ball goes straight up, was slanted without them
UPRIGHT_PLACES = 65
# Coefficients of the parabola that the levels on either side lie on while a climb is sought
GROUND_TERMS = 3


def possible_climbs(
    x: FloatArray,
    z: FloatArray,
    samples: tuple[FloatArray, FloatArray],
    scatter: Scatter,
    scale: float,
    tip_radius: float,
) -> list[Edge]:
    """Slanted edges of a profile that by themselves are worth their price; the highest first.

    Each against an upright edge, over which the ball rolls on an arc, and against no edge, on a parabola through what
    lies beside it.

    Args:
        x, z: (N,) the profile in the order of x, m.
        samples: (M,) and (M,) the same before it was brought to that many places: a median over a cell with a kink in
            it is on neither side of that.
        scatter: by which curves through it are judged.
        scale: scatter of it from place to place, m.
        tip_radius: of the ball, m.
    """
    side, found = int(0.5 * SHORTEST_LEVEL * len(x)), list[Edge]()
    if side < GROUND_TERMS:
        return found
    told, refused, width = list[tuple[float, int, int]](), list[tuple[int, int]](), 2
    while width <= LONGEST_TOLD * len(x):
        told += [(rise, middle, width) for rise, middle in rises(x, z, scale, None, width, side)]
        width *= 2
    # one may take so much of the profile that most differences are of it
    told.append((0.0, len(x) // 2, len(x)))
    # of one climb the widest that it is told at is nearest to its run
    for _, middle, width in sorted(told, key=lambda each: (-each[2], -each[0])):
        if len(found) == MOST_JUMPS or any(abs(middle - edge.index) < side for edge in found):
            continue
        if any(2 * abs(middle - other) < wider for other, wider in refused):
            continue
        first, begin, end, last = np.clip(
            middle + np.array([-width - side, -width // 2, width // 2, width + side]), 0, len(x) - 1
        )
        own = slice(*np.searchsorted(samples[0], x[[first, last]]))
        stride = 1 + (own.stop - own.start) // CLIMB_SAMPLES
        near, heights = (each[own][::stride] for each in samples)
        stretch = _Stretch(near, heights, float(x[middle]), max(scatter.least, neighbour_scatter(heights)), tip_radius)
        climb = stretch.climb(float(x[end] - x[begin]), scatter) if stretch.tells else None
        if climb is None:
            refused += [(middle, width)] if width < len(x) else []
            continue
        place, run, height, slope = climb
        if width == len(x) and run < LONGEST_TOLD * (x[-1] - x[0]):  # a stretch about it tells it better
            continue
        inside = near[0] < place - 0.5 * run and place + 0.5 * run < near[-1]  # else the levels beside it are none
        begin, index, end = (int(np.searchsorted(x, place + share * run)) - 1 for share in (-0.5, 0.0, 0.5))
        edge = Edge(index, begin, end, place, run, height, slope)
        if inside and not any(abs(edge.index - other.index) < side for other in found):
            found.append(edge)
    return sorted(found, key=lambda edge: -abs(edge.height))


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Samples (n,) about a place, m, their scatter, m, and the ball that felt them.

    Asked for are in this order: place (in spacings from the middle), log run (in spacings) unless that is given, rise,
    and the coefficients of the ground, in sizes.
    """

    x: FloatArray
    z: FloatArray
    middle: float
    scale: float
    tip_radius: float

    @property
    def tells(self) -> bool:
        """True if there are places enough."""
        return len(self.x) > 2 * (GROUND_TERMS + 3) and self.spacing > 0.0

    @cached_property
    def spacing(self) -> float:
        """Usual distance of samples, m."""
        return float(np.median(np.diff(self.x)))

    @cached_property
    def span(self) -> float:
        """Its length, m."""
        return float(self.x[-1] - self.x[0])

    @cached_property
    def size(self) -> float:
        """Of its heights, m."""
        return max(float(np.ptp(self.z)), self.scale)

    @cached_property
    def ground(self) -> FloatArray:
        """(n, GROUND_TERMS) powers of the place."""
        return np.asarray(((self.x - self.middle) / self.span)[:, None] ** np.arange(GROUND_TERMS))

    def climb(self, length: float, scatter: Scatter) -> tuple[float, float, float, float] | None:
        """Place, run, height and the ground's slope of its climb, m; None if that is not worth its price here.

        Args:
            length: about as long as it may be, m.
            scatter: by which it is judged.
        """
        slanted = self._descended([self._straight(self.middle, max(length, 2.0 * self.spacing))[1], self._begun])
        run = self.spacing * float(np.exp(slanted[1]))
        # of a flank that is never touched the upper edge is felt; no descent leads over a sample that a wall is beside
        known = np.delete(slanted, 1)
        tried = np.tile(known, (UPRIGHT_PLACES, 1))
        tried[:, 0] += np.linspace(-run, run, UPRIGHT_PLACES) / self.spacing
        costs = [float(np.log1p((self._off(each, 0.0) / FEATURE_RESIDUAL_SDS) ** 2).sum()) for each in tried]
        edge = known + np.eye(1, len(known))[0] * 0.5 * run / self.spacing * np.sign(known[1])
        upright = self._descended([known, edge, tried[int(np.argmin(costs))]], 0.0)
        plain = self.z - self.ground @ np.linalg.lstsq(self.ground, self.z, rcond=None)[0]
        own, price = scatter.misfit(self.scale * self._off(slanted)), scatter.price(len(self.z))
        over_upright = own + EDGE_FREEDOM * price < scatter.misfit(self.scale * self._off(upright, 0.0))
        if not over_upright or own + (1 + 2 * EDGE_FREEDOM) * price >= scatter.misfit(plain):
            return None
        place, height = self.middle + self.spacing * float(slanted[0]), self.size * float(slanted[2])
        return place, run, height, self._slope(slanted)

    def _slope(self, asked: FloatArray) -> float:
        """Of the ground in the middle."""
        return float(self.size * asked[1 - GROUND_TERMS] / self.span)

    def _off(self, asked: FloatArray, run: float | None = None) -> FloatArray:
        """(n,) residuals in scatters."""
        run = self.spacing * float(np.exp(asked[1])) if run is None else run
        rise = self.size * float(asked[-GROUND_TERMS - 1])
        away = self.x - self.middle - self.spacing * asked[0]
        share = felt_share(away, rise or self.size, run, self._slope(asked), self.tip_radius)
        return np.asarray((self.z - rise * share - self.ground @ (self.size * asked[-GROUND_TERMS:])) / self.scale)

    def _descended(self, starts: Sequence[FloatArray], run: float | None = None) -> FloatArray:
        """What fits best of where descents from some starts end."""
        from scipy.optimize import least_squares

        least, most = np.full(len(starts[0]), -np.inf), np.full(len(starts[0]), np.inf)
        least[0], most[0] = (self.x[0] - self.middle) / self.spacing, (self.x[-1] - self.middle) / self.spacing
        if run is None:
            least[1], most[1] = 0.0, np.log(self.span / self.spacing)
        inner = 1e-3 * np.minimum(most - least, 1.0)
        robust: dict[str, Any] = {"loss": "soft_l1", "bounds": (least, most), "args": (run,)}

        def descended(start: FloatArray, outlier: float) -> Any:
            return least_squares(self._off, np.clip(start, least + inner, most - inner), f_scale=outlier, **robust)

        if self.scale <= CONTACT_ROUNDING * self.tip_radius:
            # without noise all that a start misses counts by its size, and no descent ends there: first, so much of it
            # does not as half of it is
            apart = [max(float(np.median(np.abs(self._off(each, run)))), FEATURE_RESIDUAL_SDS) for each in starts]
            starts = [descended(each, off).x for each, off in zip(starts, apart, strict=True)]
        ends = [descended(each, FEATURE_RESIDUAL_SDS) for each in starts]
        return np.asarray(min(ends, key=lambda end: float(end.cost)).x)

    @property
    def _begun(self) -> FloatArray:
        """The best of straight climbs that the stretch may hold."""
        runs = self.span * np.geomspace(
            min(2.0 * self.spacing / self.span, 0.5), 1.0 - 2.0 / CLIMBS_TRIED, CLIMBS_TRIED
        )
        tried = [
            self._straight(float(place), float(run))
            for run in runs
            for place in np.linspace(self.x[0] + 0.5 * run, self.x[-1] - 0.5 * run, CLIMBS_TRIED)[1:-1]
        ]
        return min(tried, key=lambda each: each[0])[1]

    def _straight(self, place: float, run: float) -> tuple[float, FloatArray]:
        """Mean absolute residual of the straight climb there, and what is asked for of it."""
        ramp = np.clip((self.x - place) / run + 0.5, 0.0, 1.0)
        design = np.column_stack([ramp, self.ground])
        coefficients = np.linalg.lstsq(design, self.z, rcond=None)[0]
        known = (place - self.middle) / self.spacing, np.log(run / self.spacing)
        return float(np.abs(self.z - design @ coefficients).mean()), np.append(known, coefficients / self.size)
