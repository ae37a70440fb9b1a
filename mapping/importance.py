"""Importance: a proposal that learns the posterior from weighted draws, and says how well it does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.laplace import Laplace
from mapping.psis import effective_size, smooth_weights
from mapping.target import Target

FloatArray = NDArray[np.float64]

DEGREES = 6.0
ROUNDS = 10
DRAWS = 1000
FINAL_DRAWS = 4000
# Below this k-hat importance sampling may stand for the posterior (theory section 8).
TRUSTED_K_HAT = 0.5


@dataclass(frozen=True, eq=False)
class Proposal:
    """A multivariate Student t.

    Args:
        mean: (P,).
        root: (P, P) Cholesky factor of the scale matrix.
    """

    mean: FloatArray
    root: FloatArray

    def draw(self, normal: FloatArray, chi_square: FloatArray) -> FloatArray:
        """(S, P) draws from standard normal (S, P) and chi-square (S,) variates of DEGREES degrees of freedom."""
        return np.asarray(self.mean + (normal @ self.root.T) * np.sqrt(DEGREES / chi_square)[:, None])

    def log_density(self, theta: FloatArray) -> FloatArray:
        """(S,) log densities up to a constant that is the same for all theta."""
        from math import lgamma, log, pi

        count = len(self.mean)
        z = np.linalg.solve(self.root, (theta - self.mean).T)
        norm = lgamma((DEGREES + count) / 2) - lgamma(DEGREES / 2) - 0.5 * count * log(DEGREES * pi)
        norm -= float(np.log(np.diag(self.root)).sum())
        return norm - 0.5 * (DEGREES + count) * np.log1p((z**2).sum(axis=0) / DEGREES)


@dataclass(frozen=True, eq=False)
class Importance:
    """Weighted draws of a posterior.

    Args:
        proposal: where they came from.
        draws: (S, P).
        weights: (S,) smoothed, summing to one.
        k_hat: Pareto shape of the raw weights.
        ess: effective number of draws.
        log_evidence: log of the integral of the unnormalised density.
    """

    proposal: Proposal
    draws: FloatArray
    weights: FloatArray
    k_hat: float
    ess: float
    log_evidence: float


def importance_sample(target: Target, start: Laplace, rng: np.random.Generator) -> Importance:
    """Draws of the target, the proposal adapted from the Laplace approximation by its own weighted draws.

    While few draws carry the weight it is tempered, so that the proposal grows towards the target instead of
    collapsing on the best draw.

    Reference: Cappe, Guillin, Marin & Robert, "Population Monte Carlo", JCGS 13 (2004), with PSIS as the test.
    """
    proposal = Proposal(start.mean, _root(start.covariance))
    for _ in range(ROUNDS):
        draws, ratios = _weigh(target, proposal, rng, DRAWS)
        weights, k_hat = smooth_weights(ratios)
        if effective_size(weights) > 0.45 * DRAWS and k_hat < TRUSTED_K_HAT:
            break
        weights = _tempered(ratios, at_least=20.0 * len(start.mean))
        mean = weights @ draws
        spread = draws - mean
        proposal = Proposal(mean, _root((spread * weights[:, None]).T @ spread * (1.0 + 1.0 / len(mean))))
    draws, ratios = _weigh(target, proposal, rng, FINAL_DRAWS)
    weights, k_hat = smooth_weights(ratios)
    top = float(ratios.max())
    log_evidence = top + float(np.log(np.mean(np.exp(ratios - top))))
    return Importance(proposal, draws, weights, k_hat, effective_size(weights), log_evidence)


def _weigh(target: Target, proposal: Proposal, rng: np.random.Generator, size: int) -> tuple[FloatArray, FloatArray]:
    count = len(proposal.mean)
    draws = proposal.draw(rng.standard_normal((size, count)), rng.chisquare(DEGREES, size))
    return draws, target.log_density(draws) - proposal.log_density(draws)


def _tempered(ratios: FloatArray, at_least: float) -> FloatArray:
    """Weights to the highest power that leaves the wanted effective size."""
    shifted = ratios - ratios.max()
    power = 1.0
    for _ in range(40):
        weights = np.exp(power * shifted)
        weights /= weights.sum()
        if effective_size(weights) >= at_least:
            break
        power *= 0.75
    return np.asarray(weights)


def _root(covariance: FloatArray) -> FloatArray:
    """Cholesky factor; directions without spread get a trace of it, in each parameter's own unit."""
    sd = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    correlation = covariance / np.outer(sd, sd)
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.T))
    sound = (vectors * np.maximum(values, 1e-9)) @ vectors.T
    return np.asarray(sd[:, None] * np.linalg.cholesky(sound))
