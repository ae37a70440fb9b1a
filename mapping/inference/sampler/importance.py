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

# Draws in each round, and rounds at most. Of a low line as wide as a sticker (9 and 10 parameters, several of them at
# their limits) sixteen rounds hold 480 to 760 effective draws, its k-hat below 0.5; a chain took 8 times as long.
ROUNDS = 16
DRAWS_PER_ROUND = 1000
# Effective draws that are wanted in the end: as many as a posterior keeps.
WANTED = 1000
# Below this k-hat importance sampling may stand for the posterior (theory section 8).
TRUSTED_K_HAT = 0.5
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
    """Draws of the target, from proposals that each learn from the weighted draws of all before.

    No draw is thrown away: each is weighed by the mixture of all proposals, as many times each as it was drawn from,
    whichever it came from itself. A narrow proposal's tails are thereby covered by the wider ones before it. While few
    draws carry the weight it is tempered, so that a proposal grows towards the target instead of collapsing on the
    best draw.

    Args:
        target: the density.
        modes: its Laplace approximations.
        rng: all randomness comes from here.
        least: log evidence below which nothing more is asked than that it is below: draws that can be trusted and are
            sure of it are returned, if those of one more round are sure, too (a proposal that misses a part of the
            target may seem sure). The variance of the mean of S weights is that mean's square times
            1 / ESS - 1 / S.

    Reference: theory section 8.2; Cornuet, Marin, Mira & Robert, "Adaptive multiple importance sampling",
    Scandinavian Journal of Statistics 39 (2012); Cappé et al. 2008 for the adaptation (proposal.py has it in full),
    Vehtari et al. 2024 for the test (psis.py).
    """
    proposal, was_sure = _first_proposal(modes), False
    proposals: list[Proposal] = []
    draws = np.empty((0, proposal.means.shape[1]))
    heights, mixed = np.empty(0), np.empty(0)
    for _ in range(ROUNDS):
        new = _drawn(proposal, rng, DRAWS_PER_ROUND)
        # (S,) log of the sum of all proposals' densities, at the old draws and at the new ones
        mixed = np.concatenate(
            [
                np.logaddexp(mixed, proposal.log_density(draws)),
                np.logaddexp.reduce([each.log_density(new) for each in (*proposals, proposal)]),
            ]
        )
        proposals.append(proposal)
        draws, heights = np.concatenate([draws, new]), np.concatenate([heights, target.log_density(new)])
        ratios = heights - mixed + np.log(len(proposals))
        weights, k_hat = smooth_weights(ratios)
        ess = effective_size(weights)
        evidence, spread = _log_mean(ratios), np.sqrt(max(1.0 / ess - 1.0 / len(draws), 0.0))
        sure = k_hat < TRUSTED_K_HAT and evidence + GIVEN_UP_SDS * spread < least
        if (k_hat < TRUSTED_K_HAT and ess > WANTED) or (sure and was_sure):
            break
        was_sure = sure
        proposal = _learned(proposal, draws, ratios)
    return Importance(proposal, draws, weights, k_hat, ess, evidence)


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


def _drawn(proposal: Proposal, rng: np.random.Generator, size: int) -> FloatArray:
    count = proposal.means.shape[1]
    return proposal.draw(rng.random(size), rng.standard_normal((size, count)), rng.chisquare(DEGREES, size))


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
