"""The core of residuals of which many may stand off by anything: a normal law and an even remainder."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mapping import FloatArray
from mapping.instrument.robust import FEATURE_RESIDUAL_SDS, RobustFit, robust_scale

# Shares that may stand off. With fewer than one in ten left there is no core; the least keeps a single residual from
# ruling all others out
LEAST_OFF, MOST_OFF = 1e-4, 0.9
# The rounds end where scatter and share change by less; a cost of hundreds is then right to hundredths
EM_ROUNDS, EM_TOLERANCE = 60, 1e-4
# Standard deviations beyond which the normal law is nothing in double precision (its square must not overflow)
FARTHEST = 1e3


class Core(NamedTuple):
    """-2 log likelihood (`misfit`), standard deviation of the core, and the share of what stands off it."""

    misfit: float
    sd: float
    off: float

    def density(self, residual: FloatArray, span: float) -> FloatArray:
        """(N,) of residuals, 1/m; what stands off lies anywhere in `span`, m."""
        return self._normal(residual) + self.off / span

    def share(self, residual: FloatArray, span: float) -> FloatArray:
        """(N,) probabilities that residuals are of the core."""
        normal = self._normal(residual)
        return np.asarray(normal / (normal + self.off / span))

    def _normal(self, residual: FloatArray) -> FloatArray:
        away = np.minimum(np.abs(residual) / self.sd, FARTHEST)
        return np.asarray((1.0 - self.off) * np.exp(-0.5 * away**2) / (np.sqrt(2.0 * np.pi) * self.sd))


def span_of(residual: FloatArray, least: float) -> float:
    """The heights, m, in which what stands off may lie anywhere: those of all residuals (N,), m, and no less than where
    a core of the least scatter lies, within which nothing stands off."""
    return max(float(np.ptp(residual)), 2.0 * FEATURE_RESIDUAL_SDS * least)


def core_of(residual: FloatArray, least: float, span: float) -> Core:
    """The likeliest core of residuals (N,), m, by expectation-maximisation.

    From two starts, the least scatter and that of the bulk: the likelihood may have a maximum at either.

    Args:
        least: smallest standard deviation that the core may have, m.
        span: in which what stands off lies anywhere, m.
    """
    found = []
    for sd in {least, max(least, robust_scale(residual))}:
        core = Core(np.inf, sd, 0.5 * (LEAST_OFF + MOST_OFF))
        for _ in range(EM_ROUNDS):
            before, on = core, core.share(residual, span)
            misfit = -2.0 * float(np.log(core.density(residual, span)).sum())
            core = Core(misfit, _scatter(residual, on, least), _off(on))
            if abs(core.sd - before.sd) < EM_TOLERANCE * core.sd and abs(core.off - before.off) < EM_TOLERANCE:
                break
        found.append(core)
    return min(found)


def fit_on_densest(design: FloatArray, fit: RobustFit, least: float, span: float) -> RobustFit:
    """A fit (N, P) moved onto the height off it at which most values lie, as long as it goes on winning some.

    Least absolute misses settle between the crests and the roots of a profile of which neither are a half.

    Args:
        least, span: as of `core_of`.
    """
    values = design @ fit.coefficients + fit.residual
    ordered = np.sort(fit.residual)
    few = max(int((1.0 - MOST_OFF) * len(ordered)), 1)
    widths = ordered[few:] - ordered[:-few]
    first = int(widths.argmin())
    core = Core(np.inf, max(least, float(widths[first])), 0.5 * (LEAST_OFF + MOST_OFF))
    on = core.share(fit.residual - ordered[first + few // 2], span)
    coefficients: FloatArray = fit.coefficients
    for _ in range(EM_ROUNDS):
        before, root = coefficients, np.sqrt(on)
        coefficients = np.asarray(np.linalg.lstsq(root[:, None] * design, root * values, rcond=None)[0])
        residual = values - design @ coefficients
        if np.abs(design @ (coefficients - before)).max() < EM_TOLERANCE * core.sd:
            break
        core = Core(np.inf, _scatter(residual, on, least), _off(on))
        on = core.share(residual, span)
    return RobustFit(coefficients, values - design @ coefficients)


def _scatter(residual: FloatArray, on: FloatArray, least: float) -> float:
    total = float(on.sum())
    return max(least, float(np.sqrt(on @ residual**2 / total))) if total > 0.0 else least


def _off(on: FloatArray) -> float:
    return float(np.clip(1.0 - on.mean(), LEAST_OFF, MOST_OFF))
