"""Importance sampling: weighted draws of a posterior from an adapted proposal, and the diagnostic of their weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.inference.likelihood import LogPosterior
from mapping.inference.sampler.laplace import Laplace
from mapping.inference.sampler.proposal import DEGREES, Proposal, root_of
from mapping.inference.sampler.psis import effective_size, smooth_weights

PROPOSAL_ROUNDS = 12
DRAWS_PER_ROUND = 1000
# Effective draws that are wanted in the end: as many as a posterior keeps.
WANTED = 1000
# Final draws, those that found the proposal good among them: as many as give the effective ones that are wanted, within
# these limits. The proposal learns from them, too, if they cannot be trusted yet, and the most are drawn the next time.
FEWEST_FINAL, MOST_FINAL, FINAL_ROUNDS = 2000, 4000, 3
# Below this k-hat importance sampling may stand for the posterior (theory section 8).
TRUSTED_K_HAT = 0.5
# The proposal is good enough when this share of the draws is effective: one more round to learn from takes the draws
# that it can save at most, WANTED / EFFICIENT - FEWEST_FINAL = DRAWS_PER_ROUND. More is not always there to be had: of
# a normal density cut off in 3 of 6 parameters no mixture has half of its draws effective.
EFFICIENT = 1.0 / 3.0
# Standard deviations by which a log evidence must lie below what is asked for to be given up before it is known well
GIVEN_UP_SDS = 5.0


@dataclass(frozen=True, eq=False)
class Importance:
    """Weighted draws of a posterior.

    Args:
        proposal: where they came from.
        draws: (S, P).
        weights: (S,) smoothed, summing to one.
        k_hat: Pareto shape of the raw weights.
        ess: effective number of draws.
        log_evidence: log of the integral of the unnormalised density; -inf if no draw hit the target's support.
    """

    proposal: Proposal
    draws: FloatArray
    weights: FloatArray
    k_hat: float
    ess: float
    log_evidence: float


def importance_sample(
    target: LogPosterior, modes: Sequence[Laplace], rng: np.random.Generator, least: float = -np.inf
) -> Importance:
    """Draws of the target, the proposal adapted from Laplace approximations by its own weighted draws.

    While few draws carry the weight it is tempered, so that the proposal grows towards the target instead of
    collapsing on the best draw.

    Args:
        target: the density.
        modes: its Laplace approximations.
        rng: all randomness comes from here.
        least: log evidence below which nothing more is asked than that it is below: draws that can be trusted and are
            sure of it are returned, if the proposal that they taught gives such draws, too (one that misses a part of
            the target may seem sure). The variance of the mean of S weights is that mean's square times
            1 / ESS - 1 / S.

    Reference: theory section 8.2; Cappé et al. 2008 for the adaptation (proposal.py has it in full), Vehtari et al.
    2024 for the test (psis.py).
    """
    proposal, was_sure, known = _first_proposal(modes), False, 0
    for _ in range(PROPOSAL_ROUNDS):
        draws, ratios = _weigh(target, proposal, rng, DRAWS_PER_ROUND)
        weights, k_hat = smooth_weights(ratios)
        ess = effective_size(weights)
        spread = np.sqrt(max(1.0 / ess - 1.0 / len(draws), 0.0))
        sure = k_hat < TRUSTED_K_HAT and _log_mean(ratios) + GIVEN_UP_SDS * spread < least
        if sure and was_sure:
            return Importance(proposal, draws, weights, k_hat, ess, _log_mean(ratios))
        was_sure = sure
        if ess > EFFICIENT * DRAWS_PER_ROUND and k_hat < TRUSTED_K_HAT and not sure:
            known = len(draws)
            break
        proposal = _learned(proposal, draws, ratios)
    count = min(max(round(WANTED * len(draws) / ess), FEWEST_FINAL), MOST_FINAL)
    for final in range(FINAL_ROUNDS):
        if final:
            proposal, known, count = _learned(proposal, draws, ratios), 0, MOST_FINAL
        more = _weigh(target, proposal, rng, count - known)
        draws, ratios = (np.concatenate([old[:known], new]) for old, new in zip((draws, ratios), more, strict=True))
        weights, k_hat = smooth_weights(ratios)
        if k_hat < TRUSTED_K_HAT:
            break
    return Importance(proposal, draws, weights, k_hat, effective_size(weights), _log_mean(ratios))


def _log_mean(ratios: FloatArray) -> float:
    """Log of the mean of what they are the logs of; -inf if all of them are."""
    top = float(ratios.max())
    return top + float(np.log(np.mean(np.exp(ratios - top)))) if np.isfinite(top) else -np.inf


def _first_proposal(modes: Sequence[Laplace]) -> Proposal:
    """Each mode twice: as the Gaussian approximation has it, and twice as wide for what is not Gaussian about it."""
    means = np.repeat([mode.mean for mode in modes], 2, axis=0)
    roots = np.array([width * root_of(mode.covariance) for mode in modes for width in (1.0, 2.0)])
    shares = np.tile([0.7, 0.3], len(modes)) / len(modes)
    return Proposal(shares, means, roots).rounded()


def _weigh(
    target: LogPosterior, proposal: Proposal, rng: np.random.Generator, size: int
) -> tuple[FloatArray, FloatArray]:
    count = proposal.means.shape[1]
    draws = proposal.draw(rng.random(size), rng.standard_normal((size, count)), rng.chisquare(DEGREES, size))
    return draws, target.log_density(draws) - proposal.log_density(draws)


def _learned(proposal: Proposal, draws: FloatArray, ratios: FloatArray) -> Proposal:
    """The proposal adapted by its weighted draws; as it was if none of them hit the target's support."""
    if not np.isfinite(ratios).any():
        return proposal
    return proposal.learned(draws, _tempered(ratios, at_least=20.0 * draws.shape[1]))


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
