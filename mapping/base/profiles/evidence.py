"""Evidence of a curve through a profile: most places lie on it, some stand off it by anything."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mapping import FloatArray
from mapping.instrument import FEATURE_RESIDUAL_SDS, RobustFit, robust_scale

# Shares of places that may stand off a curve. With fewer than one in ten left on it a curve is no base; the least keeps
# a single place from ruling a profile out
LEAST_OFF, MOST_OFF = 1e-4, 0.9
# The rounds end where scatter and share change by less; a cost of hundreds is then right to hundredths
EM_ROUNDS, EM_TOLERANCE = 60, 1e-4
# A correlation below which further ones are of chance: of 480 places each is off by 0.05 (one standard deviation)
LEAST_CORRELATION = 0.05


@dataclass(frozen=True)
class Scatter:
    """What a profile's places are taken to do beside any curve.

    Args:
        least: standard deviation from place to place, m: no curve is followed closer.
        span: heights that a detail may have, m: it stands anywhere among them.
        places: over how many places deviations are alike; 1 of white noise. So many count once.
    """

    least: float
    span: float
    places: float

    @classmethod
    def left_by(cls, residual: FloatArray, least: float, span: float) -> Scatter:
        """Scatter as the freest curve leaves it: what that does not follow, none does."""
        sd = _mixture(residual, least, span).sd
        near = np.where(np.abs(residual) < FEATURE_RESIDUAL_SDS * sd, residual, 0.0)
        near = near - near.mean()
        variance, places = float(near @ near), 1.0
        for lag in range(1, len(near) // 10 if variance > 0.0 else 0):
            correlation = float(near[lag:] @ near[:-lag]) / variance
            if correlation < LEAST_CORRELATION:
                break
            places += 2.0 * correlation
        return cls(least, span, places)

    def price(self, count: int) -> float:
        """What one free coefficient of a curve through so many places costs: the logarithm of their number."""
        return float(np.log(max(count / self.places, 2.0)))

    def misfit(self, residual: FloatArray) -> float:
        """-2 log likelihood of residuals (N,), m, at the likeliest scatter and share of places that stand off.

        The scatter is free: truncated squares at a stated one prefer any curve that is about right everywhere to a
        line on which one half of a thread's profile lies and the other does not.
        """
        return _mixture(residual, self.least, self.span).misfit / self.places

    def share_on(self, residual: FloatArray) -> float:
        """Share of the places that lie on the curve."""
        return 1.0 - _mixture(residual, self.least, self.span).off

    def ends_on(self, residual: FloatArray, edges: Sequence[int]) -> bool:
        """True if most of what lies before the first edge, and beyond the last one, lies on the level there."""
        within = FEATURE_RESIDUAL_SDS * _mixture(residual, self.least, self.span).sd
        ends = residual[: min(edges) + 1], residual[max(edges) + 1 :]
        return all(float(np.median(np.abs(end))) < within for end in ends)

    def felt_part(self, residual: FloatArray, price: float) -> tuple[int, int]:
        """Indices [first, last) of the part of a profile that comes back to its curve (N,) at either end.

        What stands off beyond the last place on it may go on anywhere: it is left out where its places there cost more
        than `price`.
        """
        found = _mixture(residual, self.least, self.span)
        density = _on(residual, found.sd, found.off, self.span)[1]
        usual = 1.0 - 2.0 * np.log((1.0 - found.off) / (np.sqrt(2.0 * np.pi) * found.sd))
        saved = (-2.0 * np.log(density) - usual) / self.places
        cut = [0, 0]
        for side, order in enumerate((slice(None), slice(None, None, -1))):
            off = residual[order]
            out = np.sign(off[0]) * off > FEATURE_RESIDUAL_SDS * found.sd
            run = len(out) if out.all() else int(np.argmin(out))
            if float(saved[order][:run].sum()) > price:
                back = np.sign(off[0]) * off[run:] < found.sd
                cut[side] = run + int(np.argmax(back))
        return cut[0], len(residual) - cut[1]

    def on_densest(self, design: FloatArray, fit: RobustFit) -> RobustFit:
        """A fit (N, P) moved onto the height off it at which most places lie, as long as it goes on winning places.

        Least absolute misses settle between the crests and the roots of a profile of which neither are a half.
        """
        values = design @ fit.coefficients + fit.residual
        ordered = np.sort(fit.residual)
        few = max(int((1.0 - MOST_OFF) * len(ordered)), 1)
        widths = ordered[few:] - ordered[:-few]
        first = int(widths.argmin())
        middle, sd = ordered[first + few // 2], max(self.least, float(widths[first]))
        on = np.exp(-0.5 * ((fit.residual - middle) / sd) ** 2)
        coefficients = fit.coefficients
        for _ in range(EM_ROUNDS):
            before = coefficients
            coefficients = np.linalg.lstsq(np.sqrt(on)[:, None] * design, np.sqrt(on) * values, rcond=None)[0]
            residual = values - design @ coefficients
            if np.abs(design @ (coefficients - before)).max() < EM_TOLERANCE * sd:
                break
            sd = max(self.least, float(np.sqrt(on @ residual**2 / on.sum())))
            off = float(np.clip(1.0 - on.mean(), LEAST_OFF, MOST_OFF))
            on = _on(residual, sd, off, self.span)[0]
        return RobustFit(coefficients, values - design @ coefficients)


class _Mixture(NamedTuple):
    """A normal core and an even remainder: -2 log likelihood, standard deviation of the core, share of the rest."""

    misfit: float
    sd: float
    off: float


def _mixture(residual: FloatArray, least: float, span: float) -> _Mixture:
    """The likeliest, by expectation-maximisation.

    From two starts, the least scatter and that of the bulk: the likelihood may have a maximum at either.
    """
    found = []
    for sd in {least, max(least, robust_scale(residual))}:
        off = 0.5 * (LEAST_OFF + MOST_OFF)
        for _ in range(EM_ROUNDS):
            on, density = _on(residual, sd, off, span)
            before = sd, off
            off = float(np.clip(1.0 - on.mean(), LEAST_OFF, MOST_OFF))
            if (total := float(on.sum())) > 0.0:
                sd = max(least, float(np.sqrt(on @ residual**2 / total)))
            if abs(sd - before[0]) < EM_TOLERANCE * sd and abs(off - before[1]) < EM_TOLERANCE:
                break
        found.append(_Mixture(-2.0 * float(np.log(density).sum()), sd, off))
    return min(found)


def _on(residual: FloatArray, sd: float, off: float, span: float) -> tuple[FloatArray, FloatArray]:
    """(N,) probabilities that places lie on the curve, and the density of their residuals, 1/m."""
    core = (1.0 - off) * np.exp(-0.5 * (residual / sd) ** 2) / (np.sqrt(2.0 * np.pi) * sd)
    density = core + off / span
    return core / density, density
