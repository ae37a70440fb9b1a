"""End place: where a line ends, along it and across, by sweeps across it on either side of the end."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mapping import FloatArray
from mapping.instrument import Noise
from planners.follow.template_fit import covariance_of_means, end_heights, means_in_bins

# Where sweeps may cross the line, in half-widths of its disturbance beyond the end: those closer to each other tell the
# same; and how far beyond the end, as it is known by now, the ball still feels enough of it
OFFSETS, FARTHEST_SWEEP = np.array([-1.0, -0.75, -0.5, -0.25, *np.arange(0.0, 1.41, 0.1)]), 0.95
# Bare base that a sweep takes in beside the disturbance, in half-widths
BARE_MARGIN = 0.3
# Bins of a sweep that was not made yet; and the step of a derivative, in half-widths, heights and rad
FORETOLD_BINS, DERIVATIVE_STEP = 40, 1e-3
# A base under a sweep may lie and slope by so many times what is felt of the line, or a sample's noise: the model gives
# every sweep its own, too (mapping.inference.families.problem). That is as good as free: of a wire of 0.65 mm in 0.06
# mm noise 0.3 and 30 leave the end as well known to 0.2 %, with the same sweep chosen
VAGUE = 3.0
# Shares of the time that two sweeps may have, to be made in turn until enough is known; and how long that may take, in
# times of the shortest one: steps that tell it to a fifth, up to 300 times; beyond that what comes nearest is made
TIME_SHARES = np.array([0.25, 0.5, 0.75])
FORETOLD_TIMES = 2.0 * 1.4 ** np.arange(16)
# Standard deviations of chi-squared beyond which something else is felt than a line that ends
MISFIT_SDS = 5.0
# By how much a line may turn where it ends, of which nothing is felt before: standard deviation, rad
UNKNOWN_TURN = 0.3


@dataclass(frozen=True)
class EndSection:
    """The trace about an end, in coordinates of the base: u along the line, beyond the end, and v to the left of it.

    Args:
        sign: +1 for ridges, -1 for grooves.
        half_width: of the disturbance across the line, m.
        tip_radius: m.
        wide: how much wider shapes along and across the line would be on a flat base.
        shear: by how much u of what lies over a place changes with v, on a base that is twisted along the line.
    """

    sign: float
    half_width: float
    tip_radius: float
    wide: tuple[float, float] = (1.0, 1.0)
    shear: float = 0.0

    @property
    def beyond(self) -> float:
        """How far beyond the end of a ridge the ball still touches it, m, at a height that makes it so wide."""
        return self.half_width * self.wide[1] / self.wide[0]

    def heights(self, u: FloatArray, v: FloatArray, place: FloatArray) -> FloatArray:
        """|Height| (N,) over the base, m, of a crest that ends at place[:2] (m), turned by place[2] (rad) and place[3]
        high (m)."""
        long, wide = self.wide
        high = max(float(place[3]), 0.0)
        thin = np.sqrt(2.0 * self.tip_radius * high) / (wide * self.half_width)
        du, dv = u - place[0], v - place[1]
        cosine, sine = np.cos(place[2]), np.sin(place[2])
        along, across = cosine * du + (sine + self.shear) * dv, cosine * dv - sine * du
        return end_heights(long * along, thin * wide * across, high, self.sign, self.tip_radius)

    def derivatives(self, u: FloatArray, v: FloatArray, place: FloatArray) -> FloatArray:
        """(N, 4) of the heights, by what `place` holds."""
        step = DERIVATIVE_STEP * np.array([self.half_width, self.half_width, 1.0, place[3]])
        columns = [self.heights(u, v, place + each) - self.heights(u, v, place - each) for each in np.diag(step)]
        return np.column_stack(columns) / (2.0 * step)


@dataclass(frozen=True, eq=False)
class Across:
    """A sweep across the line.

    Args:
        offset: how far beyond the end, as it was first found, m.
        half: half its length, m.
        told: (4, 4) information that one pass gives on the end's place, the line's turn and its height.
    """

    offset: float
    half: float
    told: FloatArray


@dataclass(eq=False)
class EndPlace:
    """Where a line ends, by least squares of all sweeps across it.

    Args:
        section: what the trace looks like there.
        noise: of the samples.
        place: (4,) as the section has it, from where the end was first found.
        sd: (4,) standard deviations of it, by what was felt before.
        fits: False if a line that ends does not explain what was felt.
    """

    section: EndSection
    noise: Noise
    place: FloatArray
    sd: FloatArray
    fits: bool = field(init=False, default=True)
    _felt: dict[float, list[tuple[FloatArray, FloatArray]]] = field(init=False, default_factory=dict)
    _before: tuple[FloatArray, FloatArray] = field(init=False)  # place, and the root of what was told of it
    _told: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        known = 1.0 / np.maximum(self.sd, 1e-6 * np.array([*2 * [self.section.half_width], 1.0, self.place[3]]))
        self._before, self._told = (self.place, known), np.diag(known**2)

    @property
    def felt(self) -> bool:
        """True if any pass told of it."""
        return bool(self._felt)

    def within(self, reach: float) -> bool:
        """True if the end lies no farther from where it was first found, along and across, m."""
        return bool(np.abs(self.place[:2]).max() <= reach)

    def sweeps(self, spacing: float) -> list[Across]:
        """All sweeps that could be made, with samples so far apart, m; what each tells, by what is known by now."""
        half_width, made = self.section.half_width, []
        near = OFFSETS * half_width <= self.place[0] + FARTHEST_SWEEP * self.section.beyond
        for offset in OFFSETS[near] * half_width:
            gone = min(max(offset - self.place[0], 0.0) / self.section.beyond, 1.0) if self.section.sign > 0 else 0.0
            half = (float(np.sqrt(1.0 - gone**2)) + BARE_MARGIN) * half_width
            edges = np.linspace(-half, half, FORETOLD_BINS + 1)
            v = 0.5 * (edges[1:] + edges[:-1])
            samples = np.full(FORETOLD_BINS, 2.0 * half / FORETOLD_BINS / spacing)
            root = self._root(v, samples, self.noise)
            slopes = np.linalg.solve(root, self.section.derivatives(np.full_like(v, offset), v, self.place))
            made.append(Across(float(offset), half, slopes.T @ slopes))
        return made

    def next(self, sweeps: list[Across], seconds: FloatArray, enough: FloatArray) -> tuple[int, float]:
        """The sweep (its index) to make now, and how often it is still to be made, before enough (2,) m is known.

        Of any one or two of them, made in turn, those that take the shortest time till then; if none comes so far in
        the longest time looked at, those that come nearest. That which has the larger share of the time is first.

        Args:
            seconds: (S,) that one pass of each takes.
        """
        count = len(sweeps)
        one, other = np.triu_indices(count, 1)
        first = np.concatenate([np.arange(count), np.tile(one, len(TIME_SHARES))])
        second = np.concatenate([np.arange(count), np.tile(other, len(TIME_SHARES))])
        share = np.concatenate([np.ones(count), np.repeat(TIME_SHARES, len(one))])
        rates = np.array([each.told for each in sweeps]) / seconds[:, None, None]
        rate = share[:, None, None] * rates[first] + (1.0 - share)[:, None, None] * rates[second]
        times = FORETOLD_TIMES * seconds.min()
        known = np.linalg.inv(self._told + times[:, None, None, None] * rate)
        short = (known[..., [0, 1], [0, 1]] / enough**2).max(axis=2)
        reached = short.min(axis=1) <= 1.0
        row = int(reached.argmax()) if reached.any() else len(times) - 1
        best = int(short[row].argmin())
        chosen = int(first[best] if share[best] >= 0.5 else second[best])
        return chosen, float(max(share[best], 1.0 - share[best]) * times[row] / seconds[chosen])

    def learn(self, sweep: Across, across: FloatArray, heights: FloatArray) -> None:
        """One more pass: its places across the line (N,) and heights over the base (N,), m."""
        self._felt.setdefault(sweep.offset, []).append((across, heights))

    def _root(self, places: FloatArray, samples: FloatArray, noise: Noise) -> FloatArray:
        """(B, B) root of the covariance of means (B,) over a base that lies and slopes under each sweep as it may."""
        vague = VAGUE * max(self._before[0][3], noise.sd)
        base = vague * np.column_stack([np.ones(len(places)), (places - places.mean()) / (0.5 * np.ptp(places))])
        return np.asarray(np.linalg.cholesky(covariance_of_means(places, samples, noise) + base @ base.T))

    def solve(self) -> None:
        """The best place by all passes so far, and how well it is known."""
        from scipy.linalg import solve_triangular
        from scipy.optimize import least_squares

        sweeps = []
        for offset, felt in self._felt.items():
            v, heights = (np.concatenate(parts) for parts in zip(*felt, strict=True))
            order = np.argsort(v, kind="stable")
            at, mean, samples = means_in_bins(v[order], heights[order])
            # the correlated part of the noise averages out over the passes, not along them
            root = self._root(at, samples, self.noise.of_passes(len(felt)))
            sweeps.append((np.full_like(at, offset), at, self.section.sign * mean, root))
        first, known = self._before

        def residual(place: FloatArray) -> FloatArray:
            parts = [
                solve_triangular(root, self.section.heights(u, v, place) - mean, lower=True, check_finite=False)
                for u, v, mean, root in sweeps
            ]
            return np.concatenate([*parts, known * (place - first)])

        half_width = self.section.half_width
        scale = 0.01 * np.array([half_width, half_width, 1.0, first[3]])
        fit = least_squares(residual, self.place, x_scale=scale)
        jacobian = np.asarray(fit.jac)
        self.place, self._told = np.asarray(fit.x), jacobian.T @ jacobian
        self.sd = np.sqrt(np.diag(np.linalg.inv(self._told)))
        means = sum(len(at) for _, at, _, _ in sweeps)
        self.fits = bool(2.0 * fit.cost <= means + MISFIT_SDS * np.sqrt(2.0 * means))
