"""Laplace: the optimum of a posterior and the Gaussian that touches it there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np

from mapping import FloatArray
from mapping.inference.likelihood import LogPosterior

ITERATIONS = 60
# Gain in chi-square of a step after which the optimum is known: a tenth of a standard deviation.
SETTLED_CHI_SQUARE_GAIN = 1e-2
# Chi-square within which a search goes where an earlier one ended: half of a standard deviation.
SAME_OPTIMUM = 0.25
# What differs by less of itself is equally good, and the first of them is taken: rounding (1e-13 of the chi-square of
# thousands of bins) must not choose between steps, nor between optima.
SAME_COST = 1e-9
# A search is given up where so many times what its linear model promises would not bring it where it is of use, from
# this iteration on: the first go where the data know least, and learn most on the way. Of the 92 configurations that
# were of use among 215 that were tried on bodies of building seeds (`explore3d bench bodies`) 8 gave up none, 4 two.
# Where another start is of use none is given up: one of two likely ends of a bump's bell lay behind a long bent valley
PROMISES, LEARNING = 8.0, 3
# Log density below the best optimum at which another one does not matter, and how many are kept.
NEGLIGIBLE_LOG_DENSITY = 12.0
# Places of a scan: over 4 standard deviations to both sides they are 0.27 of one apart, and a sum over a Gaussian is
# exact to 1e-8 with one; where they are three apart its width is known to a third
SCAN = 31
MOST_MODES = 3


@dataclass(frozen=True, eq=False)
class Laplace:
    """Optimum and curvature.

    Args:
        mean: (P,) parameters of the highest density.
        covariance: (P, P) inverse of the Gauss-Newton Hessian, with flat directions replaced by the spread of the
            density along them.
        log_density: at the optimum.
    """

    mean: FloatArray
    covariance: FloatArray
    log_density: float

    @property
    def log_evidence(self) -> float:
        """Log of the integral of the density, were it this Gaussian."""
        return self.log_density + 0.5 * float(np.linalg.slogdet(2.0 * np.pi * self.covariance)[1])


def find_optima(
    target: LogPosterior,
    starts: FloatArray,
    iterations: int = ITERATIONS,
    most: float = np.inf,
    learning: int = LEARNING,
) -> list[FloatArray]:
    """Distinct optima (P,) reached by Levenberg-Marquardt from the starts (M, P), best first.

    Equally good ones (a crest that ends between either pair of sweeps, mirrored) come in the order of their starts.
    Optima that hold a negligible share of the probability, or lie within a fraction of a step of a better one, are
    left out; at most MOST_MODES are kept. After so many iterations a search stops where it is. One that begins where
    an earlier one ended is over.

    Args:
        target: the density.
        starts: where searches begin.
        iterations: that a search may take.
        most: chi-square (of data and priors) above which no optimum is of use: where no search promises less, all
            are given up, and there is none.
        learning: iterations that a search may take before it is given up.
    """
    ends = _known(target).optima
    reached: list[tuple[FloatArray, float]] = []
    gave_up = False
    for start in starts:
        if start.tobytes() in ends:
            reached.append((start, np.inf))
            continue
        search = _descend(target, start, iterations, reached, np.inf if reached else most, learning)
        if search is None:
            gave_up = True
        elif gave_up:  # it is of use after all: no start is given up
            return find_optima(target, starts, iterations)
        else:
            reached.append(search)
    if not reached:
        return []
    found = np.array([optimum for optimum, _ in reached])
    ends.update(optimum.tobytes() for optimum in found if iterations >= ITERATIONS)
    values = target.log_density(found)
    kept: list[FloatArray] = []
    for i in _best_first(values):
        apart = [np.abs((found[i] - other) / target.shape.step).max() > 0.5 for other in kept]
        if values[i] > values.max() - NEGLIGIBLE_LOG_DENSITY and all(apart) and len(kept) < MOST_MODES:
            kept.append(found[i])
    return kept or [starts[0]]


def _best_first(values: FloatArray) -> list[int]:
    """Indices from the highest value on, those that only rounding tells apart in their own order."""
    left, order = list(range(len(values))), []
    while left:
        best = max(values[left])
        order.append(next(i for i in left if not values[i] < best - SAME_COST * max(1.0, abs(best))))
        left.remove(order[-1])
    return order


def laplace(target: LogPosterior, optimum: FloatArray, *, scanned: bool = True) -> Laplace:
    """The Gaussian at an optimum; differences are taken over a good part of a standard deviation.

    A posterior with kinks (an end between two sweeps) has no useful curvature at a point: along each parameter whose
    density over +-3 standard deviations disagrees with the Gaussian's, the spread of a scan along it counts (unless
    it is not `scanned`, at a third of the cost). What was asked before is not worked out again.
    """
    known = _known(target).modes
    key = optimum.tobytes(), scanned
    if key not in known:
        known[key] = _laplace(target, optimum, scanned)
    return known[key]


def _laplace(target: LogPosterior, optimum: FloatArray, scanned: bool) -> Laplace:
    step = target.shape.step.copy()
    for _ in range(3):
        jacobian = _central(target, optimum, step)[1]
        covariance = _inverse(jacobian.T @ jacobian, target)
        step = np.clip(0.3 * np.sqrt(np.diag(covariance)), 1e-3 * target.shape.step, 10 * target.shape.step)
    if scanned:
        covariance = _scanned(target, optimum, covariance)
    return Laplace(optimum, covariance, float(target.log_density(optimum[None])[0]))


@dataclass(eq=False)
class _Known:
    """What was found out about a density: where searches ended, and the Gaussian at some places, scanned or not."""

    optima: set[bytes] = field(default_factory=set)
    modes: dict[tuple[bytes, bool], Laplace] = field(default_factory=dict)


# Kept as long as the density is: families are weighed roughly, and those that may be likely once more, by draws
_KNOWN: WeakKeyDictionary[LogPosterior, _Known] = WeakKeyDictionary()


def _known(target: LogPosterior) -> _Known:
    return _KNOWN.setdefault(target, _Known())


def linearised(target: LogPosterior, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (m,) at parameters (P,), priors as data, and their derivatives (m, P)."""
    return _central(target, theta, 0.1 * target.shape.step)


def _descend(
    target: LogPosterior,
    start: FloatArray,
    iterations: int,
    earlier: Sequence[tuple[FloatArray, float]],
    most: float,
    learning: int,
) -> tuple[FloatArray, float] | None:
    """Where a search from a start (P,) ends, and chi-square there; those of an earlier one if it comes as near.

    None if it is given up, for it promises no chi-square of `most` or less after `learning` iterations.
    """
    low, high, scale = target.low, target.high, target.shape.step
    theta = np.clip(start, low, high)
    # Where the data say nothing the prior's width is the curvature: rounding is not divided by nothing there
    prior = np.diag((scale / _widths(target)) ** 2)
    damping, sure = 1e-3, False
    residual = target.residuals(theta[None])[0]
    jacobian = _ahead(target, theta, residual, 0.1 * scale)
    cost = float(residual @ residual)
    for turn in range(iterations):
        scaled = jacobian * scale
        outwards = scaled.T @ residual
        # What lies at its bound and would go beyond stays there: a step with it, clipped, is none that the others would
        # take, and leaves them to crawl (projected Newton: Bertsekas, SIAM J. Control Optim. 20, 1982)
        scaled = scaled * ~(((theta <= low) & (outwards > 0.0)) | ((theta >= high) & (outwards < 0.0)))
        gradient, hessian = scaled.T @ residual, scaled.T @ scaled
        if turn >= learning and cost > most:
            promised = float(gradient @ shortest_solution(hessian + prior, gradient))
            if cost - PROMISES * promised > most:
                return None
        # Several dampings are tried at once: a batch of templates costs little more than one.
        dampings = damping * np.array([1e-2, 1.0, 1e2, 1e4])
        ridge = np.maximum(np.diag(hessian), 1e-6 * max(float(np.diag(hessian).max()), 1e-300))
        moves = np.stack([shortest_solution(hessian + prior + d * np.diag(ridge), -gradient) for d in dampings])
        candidates = np.clip(theta + moves * scale, low, high)
        residuals = target.residuals(candidates)
        costs = (residuals**2).sum(axis=1)
        pick = int(np.argmax(costs <= costs.min() * (1.0 + SAME_COST)))
        gain = cost - float(costs[pick])
        if better := gain > 1e-9 * max(1.0, abs(cost)) * 1e-3:
            theta, damping = candidates[pick], max(float(dampings[pick]), 1e-12)
            cost, residual = float(costs[pick]), residuals[pick]
            for optimum, least in earlier:
                apart = (optimum - theta) / scale
                if least <= cost < least + SAME_OPTIMUM and float(apart @ (hessian + prior) @ apart) < SAME_OPTIMUM:
                    return optimum, least
        if sure and not better:
            if damping > 1e6:
                break
            damping *= 1e3
            continue
        settled = gain < SETTLED_CHI_SQUARE_GAIN
        if sure and settled:
            break
        # Quotients to one side lead down at half of the cost; where they lead no further, both sides are asked
        sure = settled
        jacobian = _central(target, theta, 0.1 * scale)[1] if sure else _ahead(target, theta, residual, 0.1 * scale)
    return np.asarray(theta), cost


def shortest_solution(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """The shortest of all solutions (P,) of the least squares of a matrix (P, P) whose diagonal is positive.

    Two shapes that lie one on the other, as where a search begins, leave a matrix that is singular to rounding: what
    they differ by changes nothing, and stays.
    """
    unit = 1.0 / np.sqrt(np.diag(matrix))
    return np.asarray(unit * np.linalg.lstsq(matrix * np.outer(unit, unit), unit * right)[0])


def _ahead(target: LogPosterior, theta: FloatArray, residual: FloatArray, step: FloatArray) -> FloatArray:
    """Differences (m, P) of the residuals (m,) to that side on which there is more room."""
    count = len(theta)
    up, down = np.minimum(theta + step, target.high), np.maximum(theta - step, target.low)
    # away from bounds both sides are as long, and rounding must not choose one
    beside = np.where(up - theta >= (1.0 - SAME_COST) * (theta - down), up, down)
    batch = np.tile(theta, (count, 1))
    np.fill_diagonal(batch, beside)
    span = beside - theta
    return ((target.residuals(batch) - residual) / np.where(span == 0.0, np.finfo(float).tiny, span)[:, None]).T


def _central(target: LogPosterior, theta: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (m,) and their central differences (m, P), one-sided at a bound; a single batch of templates."""
    count = len(theta)
    up = np.minimum(theta + step, target.high)
    down = np.maximum(theta - step, target.low)
    batch = np.tile(theta, (2 * count + 1, 1))
    batch[np.arange(count), np.arange(count)] = up
    batch[np.arange(count) + count, np.arange(count)] = down
    residuals = target.residuals(batch)
    span = np.maximum(up - down, np.finfo(float).tiny)
    return residuals[-1], ((residuals[:count] - residuals[count : 2 * count]) / span[:, None]).T


def _widths(target: LogPosterior) -> FloatArray:
    """(P,) standard deviations of the priors where bounded, else generous multiples of the step."""
    with np.errstate(invalid="ignore"):
        width = (target.high - target.low) / np.sqrt(12.0)
    return np.asarray(np.where(np.isfinite(width), width, 1e3 * target.shape.step))


def _inverse(hessian: FloatArray, target: LogPosterior) -> FloatArray:
    """Inverse with the priors' widths as the least curvature, scaled so that units do not matter."""
    width = _widths(target)
    scaled = hessian * np.outer(width, width) + np.eye(len(width))
    return np.asarray(np.linalg.inv(scaled) * np.outer(width, width))


def _scanned(target: LogPosterior, optimum: FloatArray, covariance: FloatArray) -> FloatArray:
    """The covariance with rows rescaled where a scan along a parameter finds another conditional spread."""
    precision = np.linalg.inv(covariance)
    conditional = 1.0 / np.sqrt(np.diag(precision))
    factors = np.ones(len(optimum))
    grid = np.linspace(-1.0, 1.0, SCAN)
    for i in range(len(optimum)):
        reach = max(4.0 * conditional[i], 8.0 * target.shape.step[i])
        low, high = max(optimum[i] - reach, target.low[i]), min(optimum[i] + reach, target.high[i])
        batch = np.tile(optimum, (len(grid), 1))
        batch[:, i] = 0.5 * (low + high) + 0.5 * (high - low) * grid
        log_density = target.log_density(batch)
        weight = np.exp(log_density - log_density.max())
        mean = np.average(batch[:, i], weights=weight)
        spread = np.sqrt(np.average((batch[:, i] - mean) ** 2, weights=weight))
        if spread > 1.5 * conditional[i]:
            factors[i] = spread / conditional[i]
    return np.asarray(covariance * np.outer(factors, factors))
