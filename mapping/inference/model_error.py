"""Model error: the residual of the best shape beyond the noise is put into the noise (theory section 8.1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import FloatArray
from mapping.inference.families import MODEL_FLOOR, PosteriorProblem
from mapping.inference.likelihood import bin_filter
from mapping.inference.sampler import find_optima
from mapping.instrument import Noise

# A whitened bin further out than this is an outlier, as long as few are.
WHITENED_OUTLIER_SDS = 4.5
MOST_OUTLIER_SHARE = 0.03
# Places along each bounded parameter from which a better optimum is sought: the priors of places span three half-widths
# of the disturbance, and a descent finds its way from a quarter of one
SCANNED = 25
# Standard deviations of chi-square by which the residual must exceed the noise to count as a misfit.
EXCESS = 5.0


def account_for_misfit(
    problem: PosteriorProblem, optima: list[FloatArray]
) -> tuple[PosteriorProblem, list[FloatArray]]:
    """The problem with outliers given more variance and, if the residual is still too large, with noise to match.

    Single outlying bins get the variance that makes them ordinary (a Gaussian scale mixture, one step of its EM). What
    does not fit may be a descent that was caught on the way (a template with kinks has many hollows): a better place
    is sought along each parameter first. A residual that is too large all over even so means that the feature is not
    of the family, or the noise is not what was said: white and correlated levels that explain it are then found by
    maximum likelihood, so that the intervals contain it (model discrepancy; Kennedy and O'Hagan, Bayesian calibration
    of computer models, JRSS B 63, 2001).
    """
    residual = _residual(problem, optima)
    if _excess(residual) > EXCESS:
        optima = find_optima(problem.target, np.array([*optima, _elsewhere(problem)]))
        residual = _residual(problem, optima)
    wild = np.abs(residual) > WHITENED_OUTLIER_SDS
    if wild.any() and wild.mean() < MOST_OUTLIER_SHARE:
        inflation = np.where(wild, residual**2, 1.0)
        problem = problem.under(problem.noise, inflation)
        optima = find_optima(problem.target, np.array(optima))
        residual = _residual(problem, optima)
    excess = _excess(residual)
    if excess <= EXCESS:
        return problem, optima
    noise = _noise_of_residual(problem, optima[0])
    misfit = 0.0 if noise == problem.noise else excess
    problem = replace(problem.under(noise), misfit=misfit)
    return problem, find_optima(problem.target, np.array([*optima, *problem.beginnings]))


def _excess(residual: FloatArray) -> float:
    """Chi-square beyond its mean, in its standard deviations."""
    count = len(residual)
    return (float(residual @ residual) - count) / float(np.sqrt(2.0 * count))


def _elsewhere(problem: PosteriorProblem) -> FloatArray:
    """(P,) the likeliest of places along each bounded parameter, the others where the search began."""
    target = problem.target
    begin = target.shape.start
    bounded = np.flatnonzero(np.isfinite(target.low) & np.isfinite(target.high))
    batch = np.tile(begin, (len(bounded) * SCANNED, 1))
    for k, i in enumerate(bounded):
        batch[k * SCANNED : (k + 1) * SCANNED, i] = np.linspace(target.low[i], target.high[i], SCANNED)
    return np.asarray(batch[int(np.argmax(target.log_density(batch)))] if len(batch) else begin)


def _residual(problem: PosteriorProblem, optima: list[FloatArray]) -> FloatArray:
    """(n,) whitened residual at the best optimum."""
    return problem.target.residuals(optima[0][None])[0, : len(problem.window)]


def _noise_of_residual(problem: PosteriorProblem, optimum: FloatArray) -> Noise:
    """The most likely noise, not below the given one, for the heights that the optimum leaves over."""
    window = problem.window
    over = window.height - problem.target.templates(optimum[None])[0]
    for start, stop in zip(window.starts[:-1], window.starts[1:], strict=True):
        over[start:stop] -= over[start:stop].mean()
    given = problem.noise
    level = max(float(np.std(over * np.sqrt(window.passes))), MODEL_FLOOR * problem.sizes.height)
    whites = [given.white, *(level * np.sqrt((window.count / window.passes).mean()) * np.array([0.1, 0.3, 1.0]))]
    best, best_value = given, -np.inf
    for white in whites:
        for correlated in (given.correlated, 0.5 * level, level, 1.5 * level):
            for length in problem.sizes.half_width * np.array([0.1, 0.3, 1.0]):
                noise = replace(
                    given,
                    white=max(given.white, float(white)),
                    correlated=max(given.correlated, float(correlated)),
                    length=given.length if correlated <= given.correlated else float(length),
                )
                whitener = bin_filter(window, noise, MODEL_FLOOR * problem.sizes.height)
                innovations = whitener.whiten(over[None])[0]
                value = float(np.log(whitener.scale).sum() - 0.5 * innovations @ innovations)
                if value > best_value:
                    best, best_value = noise, value
    return best
