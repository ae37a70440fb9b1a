"""Pooled residual: what all crossings of a feature together, laid over one another, say against its family.

A family that is a little wrong leaves at each crossing less than the noise, and at all of them the same. The residual
at the optimum is therefore tested in one direction for each part of the section (cubic B-splines of the distance from
the axis), and of a line in those of a height that varies along it. Directions that the family's own parameters or the
base's nuisance could have taken are left out (a score test; Rao, Proc. Cambridge Phil. Soc. 44, 1948). In units of
what remains of the residual the statistic follows Fisher's F: a noise that was said a little too small counts for
nothing.

The same splines, with amplitudes of their own instead of a family's, are a section that is free: by it something is
there, whatever its form (theory section 8.5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mapping import Feature, FloatArray, length_text
from mapping.geometry.mesh import spline_design
from mapping.inference.curves import ends_on_face
from mapping.inference.families import PRECISE, PosteriorProblem, with_nominal_tip
from mapping.inference.kinds import kind_of
from mapping.inference.likelihood import LogPosterior
from mapping.inference.sampler import linearised

# Splines over the disturbance, to this many half-widths of it on either side: caps, bars and skirts differ over no less
# than a fifth of a half-width
POOLED_SPLINES = 14
POOLED_REACH = 1.25
# Legendre polynomials of the height along a line: that it grows, sags, and both
ALONG_DEGREES = 3
# Chance by which a true family is remarked upon: of 128 lines of explore3d bench sections --building whose family the
# house has 1 fell below 0.005, 2 below 0.01, 6 below 0.05, as the law says. Of a hundred models of twenty features one
# has a false remark by this test alone; where a line is taken for another kind there are more (2 of 35 reported lines)
REMARKED_CHANCE = 5e-4
# Standard deviation of a free section's amplitudes, in heights of the detection: as wide as a family's prior of them
FREE_AMPLITUDE = 2.0
# By about this share of its height a section differs from the closest of a family: bars from caps by a tenth (seen on
# two bars of the building set, not simulated)
OFF_BY = 0.1
# Bins for each spline, without which it would follow the noise of a few
BINS_PER_SPLINE = 8
# Cubic splines are four at least. Whether anything is there the odds ask of so few bins, too: they pay for each spline
FEWEST_SPLINES = 4


@dataclass(frozen=True, eq=False)
class PooledResidual:
    """The test of a family, and what a free section says instead.

    Args:
        chance: by which the family leaves as much; 1 where too little was felt to tell.
        worst: largest deviation of the pooled section from the family's, m.
        along: True if the height varies along the line, rather than the section being another.
        log_odds: log Bayes factor of the free section against nothing, the axis's freedom paid for.
    """

    chance: float
    worst: float
    along: bool
    log_odds: float

    def remarked(self, size: float) -> bool:
        """True if the family is not the feature's: surely, and by more than a smoothed path does to a height (m)."""
        return self.chance < REMARKED_CHANCE and self.worst > PRECISE * abs(size)


def pooled_residual(problem: PosteriorProblem, theta: FloatArray) -> PooledResidual:
    """Test a posed problem at its optimum (P,), under the noise that it is posed with."""
    target = problem.target
    section, places = _section(problem, theta)
    ways = [each for each in (section, _lengthwise(problem, theta, places) * section.any(axis=0)) if len(each)]
    if not len(section):
        return PooledResidual(1.0, 0.0, False, -np.inf)
    odds = _free_log_odds(problem, section)
    if section.any(axis=0).sum() < FEWEST_SPLINES * BINS_PER_SPLINE:
        return PooledResidual(1.0, 0.0, False, odds)
    residual, slopes = linearised(target, theta)
    fits = []
    for columns in ways:
        white = _whitened(target, columns)
        white = np.pad(white, ((0, 0), (0, len(residual) - white.shape[1])))
        chance, amplitudes = _score(residual, slopes, white, OFF_BY * problem.sizes.height)
        fits.append((chance, float(np.abs(amplitudes @ columns).max())))
    # each of the two had its chance (Bonferroni)
    chance, worst = min(fits)
    return PooledResidual(min(1.0, len(fits) * chance), worst, min(fits) is not fits[0], odds)


def with_remark(feature: Feature, pooled: PooledResidual, *, raised: bool) -> Feature:
    """The feature with a remark if no family of its kind fits, its height then as uncertain as the form.

    Args:
        feature: as its most probable family describes it.
        pooled: the test of that family.
        raised: True if the noise had to be raised for the family.
    """
    formed = pooled.remarked(feature.height.median)
    if not formed and not raised:
        return feature
    closest = f"no ideal {feature.kind} fits the trace within its noise: the sizes are those of the closest one"
    misfit = closest
    height = feature.height
    if formed:
        what = "its height varies along it" if pooled.along else "its section is another"
        misfit = f"{closest} ({what}: all crossings together are off by up to {length_text(pooled.worst, 2)})"
        low, high = height.low - pooled.worst, height.high + pooled.worst
        # on which side it stands is no question of its form
        low, high = max(low, 0.0) if height.low >= 0.0 else low, min(high, 0.0) if height.high <= 0.0 else high
        height = replace(height, low=low, high=high)
    details = replace(feature.details, misfit=misfit)
    return replace(feature, height=height, details=details, notes=(*feature.notes, misfit))


def _section(problem: PosteriorProblem, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(M, n) splines of the distance from the axis at each bin, and the (n,) places along it, -1 to 1.

    Bins that the ball reaches over an end of the line, or where a neighbour stands out as well, say nothing here.
    """
    shape: Any = with_nominal_tip(problem).target.shape
    window, kind = problem.window, kind_of(problem.feature)
    beside = problem.target.beside
    inside = np.ones(len(window), dtype=bool) if beside is None else beside.apart.copy()
    if kind.line:
        s, lateral, _ = shape.chart.coordinates(window.feet)
        away = lateral - shape.modes.lateral(theta[None, : shape.modes.count], s)[0]
        low, high = float(shape.chart.s[0]), float(shape.chart.s[-1])
        if "start" in shape.names:
            first = shape.names.index("start")
            ends = theta[None, first : first + 2]
            low, high = ends_on_face(shape.chart, shape.modes, theta[None, : shape.modes.count], ends)[0].tolist()
            margin = problem.sizes.radius  # over which an end may be rounded
            inside &= (s > low + margin) & (s < high - margin)
        places = np.clip(2.0 * (s - low) / max(high - low, 1e-300) - 1.0, -1.0, 1.0)
    else:
        place = np.zeros(2)
        place[: shape.free] = theta[: shape.free]
        away = np.linalg.norm(window.feet - shape.spot.point - place @ shape.spot.axes, axis=1)
        places = np.zeros(len(window))
    reach = POOLED_REACH * problem.sizes.half_width
    low = -reach if kind.line else 0.0
    inside &= np.abs(away) < reach
    count = min(POOLED_SPLINES if kind.line else POOLED_SPLINES // 2, int(inside.sum()) // BINS_PER_SPLINE)
    count = max(count, FEWEST_SPLINES)
    if inside.sum() <= count:
        return np.zeros((0, len(window))), places
    step = (reach - low) / (count - 3)
    knots = low + step * np.arange(-3.0, count + 1.0)
    values = np.zeros((count, len(window)))
    values[:, inside] = spline_design(away[inside], knots, 3).T
    return values[values.any(axis=1)], places


def _lengthwise(problem: PosteriorProblem, theta: FloatArray, places: FloatArray) -> FloatArray:
    """(K, n) heights that grow along a line: its own trace times polynomials of the place along it."""
    runs = len(problem.window.starts) - 1
    if not kind_of(problem.feature).line or runs < 2:
        return np.zeros((0, len(places)))
    trace = problem.target.shape.templates(theta[None])[0]
    trace /= max(float(np.abs(trace).max()), np.finfo(float).tiny)
    degrees = range(1, min(ALONG_DEGREES, runs - 1) + 1)
    return np.array([trace * np.polynomial.legendre.Legendre.basis(degree)(places) for degree in degrees])


def _whitened(target: LogPosterior, columns: FloatArray) -> FloatArray:
    """(K, n) columns of heights as the likelihood sees them."""
    return target.likelihood.residuals(target.likelihood.window.height - columns)


def _score(residual: FloatArray, slopes: FloatArray, columns: FloatArray, prior: float) -> tuple[float, FloatArray]:
    """Chance of as large a score as that of the residual (m,) along columns (K, m), and their amplitudes (K,).

    The amplitudes' prior (standard deviation, m) keeps those small that the data hardly know.
    """
    from scipy.special import fdtrc

    scale = np.linalg.norm(slopes, axis=0)
    left, strength, _ = np.linalg.svd(slopes / np.where(scale > 0.0, scale, 1.0), full_matrices=False)
    own = left[:, strength > 1e-9 * strength.max(initial=1.0)]
    free = columns.T - own @ (own.T @ columns.T)
    basis, strength, turn = np.linalg.svd(free, full_matrices=False)
    # what the family can do itself all but wholly is no direction of its own
    kept = strength > 1e-3 * strength.max(initial=1e-300)
    along = basis[:, kept].T @ residual
    amplitudes = turn[kept].T @ (along * strength[kept] / (strength[kept] ** 2 + 1.0 / prior**2))
    count, rest = int(kept.sum()), residual - own @ (own.T @ residual)
    left_over = float(rest @ rest - along @ along)
    degrees = len(residual) - own.shape[1] - count
    if count == 0 or degrees < count:
        return 1.0, amplitudes
    ratio = float(along @ along) / count / max(left_over / degrees, np.finfo(float).tiny)
    return float(fdtrc(count, degrees, ratio)), amplitudes


def _free_log_odds(problem: PosteriorProblem, section: FloatArray) -> float:
    """Of a free section against nothing; amplitudes marginalised (Rasmussen and Williams 2006, section 2.7)."""
    target, shape = problem.target, problem.target.shape
    data, columns = target.likelihood.residuals(target.bare)[0], _whitened(target, section)
    prior, gram, along = FREE_AMPLITUDE * problem.sizes.height, columns @ columns.T, columns @ data
    explained = 0.5 * float(along @ np.linalg.solve(gram + np.eye(len(section)) / prior**2, along))
    freedom = 0.5 * float(np.linalg.slogdet(np.eye(len(section)) + prior**2 * gram)[1])
    # the axis was chosen by these data: each of its parameters costs what Schwarz's criterion says
    return explained - freedom - 0.5 * len(shape.names) * float(np.log(len(problem.window)))
