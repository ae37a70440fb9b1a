"""Sampling: emcee with differential evolution, run until its autocorrelation time is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping import FloatArray, SamplerError
from mapping.inference.likelihood import LogPosterior
from mapping.inference.sampler.emcee_import import emcee
from mapping.inference.sampler.proposal import DEGREES, Proposal

# Walkers at least and at most; so many bins a step cost no more than what emcee does beside them, whoever sees them.
WALKERS, MOST_WALKERS = 20, 48
FREE_BINS = 12_000
# Steps of a chain, at most, and values of all of its walkers: 50 to 80 ns each, so that it ends within 10 CPU s. Up to
# 25,000 values a step, twice the free ones, the steps are the bound
LONGEST_CHAIN, MOST_CHAIN_VALUES = 6000, 150_000_000
# Share of the steps that propose from an adapted proposal: where its tails are too light walkers stick, and the others
# set them free.
INDEPENDENT = 0.5
# A chain counts as long when it holds this many autocorrelation times, and their estimate has settled.
TIMES = 100
SETTLED_TIME_CHANGE = 0.01
FIRST_LOOK = 200
GROWTH = 1.06
# Effective draws after which a chain that cannot become long any more ends: they tell a limit of a 90 % interval to a
# tenth of a standard deviation (sqrt(0.05 * 0.95 / 500) over the normal density there, 0.103)
ENOUGH_DRAWS = 500


@dataclass(frozen=True, eq=False)
class Chain:
    """What an ensemble run gave.

    Args:
        samples: (S, P) draws after burn-in, thinned to about an autocorrelation time.
        tau: largest integrated autocorrelation time, steps.
        acceptance: mean acceptance fraction.
        status: "converged", "chain too short" or "stuck".
        reason: one sentence.
        ess: effective number of draws (walkers times steps over tau).
        steps: steps taken.
    """

    samples: FloatArray
    tau: float
    acceptance: float
    status: str
    reason: str
    ess: float
    steps: int


def walkers_for(bins: int, parameters: int) -> int:
    """How many walkers sample a density over so many bins and parameters at the least cost a draw."""
    return max(min(max(FREE_BINS // bins, WALKERS), MOST_WALKERS), 2 * parameters + 4)


def steps_for(bins: int, walkers: int) -> int:
    """How many steps of so many walkers a chain over so many bins may take."""
    return max(FIRST_LOOK, min(LONGEST_CHAIN, MOST_CHAIN_VALUES // (bins * walkers)))


def sample_ensemble(
    target: LogPosterior,
    starts: FloatArray,
    rng: np.random.Generator,
    *,
    proposal: Proposal | None = None,
    max_steps: int = LONGEST_CHAIN,
) -> Chain:
    """Draw from a target by an ensemble of walkers.

    Differential evolution with an occasional jump of full length between modes (gamma0 = 1); half of the steps
    propose from `proposal` instead, independently of the walker (Metropolis-Hastings), which costs
    nothing where the proposal is good and is refused where it is not. The snooker move of emcee 3.1.6 is wrong and
    not used.

    Args:
        target: the posterior density.
        starts: (W, P) places of the walkers, W even and at least 2 P, inside the support.
        rng: all randomness comes from here.
        proposal: the adapted importance proposal, or None.
        max_steps: steps after which the run ends unconverged; sooner, with ENOUGH_DRAWS, where it sees that it will.

    Reference: theory section 8.3, with Foreman-Mackey et al. 2013 (emcee), Goodman and Weare 2010 (stretch move),
    ter Braak 2006 (differential evolution) and ter Braak and Vrugt 2008 (snooker) in full.
    """
    package = emcee()

    moves = [(package.moves.DEMove(), 0.9), (package.moves.DEMove(gamma0=1.0), 0.1)]
    if proposal is not None:
        moves = [(move, (1.0 - INDEPENDENT) * weight) for move, weight in moves]
        moves.append((package.moves.MHMove(_independent(proposal)), INDEPENDENT))
    sampler = package.EnsembleSampler(*starts.shape, target.log_density, moves=moves, vectorize=True)
    # emcee's own form of it prints all walkers and a traceback of whatever passes through: of an interruption, too
    sampler.log_prob_fn = target.log_density
    _seed(sampler, rng)
    state, tau, look = starts, np.inf, FIRST_LOOK
    while True:
        state = sampler.run_mcmc(state, look - sampler.iteration, skip_initial_state_check=True)
        previous, tau = tau, _autocorrelation(sampler.get_chain())
        settled = abs(tau - previous) < SETTLED_TIME_CHANGE * tau
        if (settled and look > TIMES * tau) or look >= max_steps or not np.isfinite(tau):
            break
        if TIMES * tau > max_steps:
            enough = int(ENOUGH_DRAWS * tau / len(starts))
            if look > enough:
                break
            look = min(int(1.02 * enough) + 1, max_steps)
            continue
        # The last stretch is short, so that the estimate is compared with one from nearly the same chain.
        look = min(max(int(GROWTH * look), min(int(1.02 * TIMES * tau), 4 * look)), max_steps)
    return _chain(sampler, tau, settled)


def _chain(sampler: Any, tau: float, settled: bool) -> Chain:
    chain: FloatArray = sampler.get_chain()
    steps, walkers, _ = chain.shape
    acceptance = float(np.mean(sampler.acceptance_fraction))
    if not np.isfinite(tau) or acceptance < 0.01:
        status, reason = (
            "stuck",
            f"after {steps} steps of {walkers} walkers {acceptance:.1%} of the moves were accepted",
        )
    elif steps > TIMES * tau and settled:
        status = "converged"
        reason = f"{steps} steps of {walkers} walkers are {steps / tau:.0f} autocorrelation times of {tau:.1f} steps"
    else:
        status = "chain too short"
        reason = (
            f"{steps} steps of {walkers} walkers are only {steps / tau:.0f} autocorrelation times ({tau:.1f} steps)"
        )
    burn = min(int(5 * tau), steps // 4) if np.isfinite(tau) else steps // 2
    thin = max(1, int(tau)) if np.isfinite(tau) else 1
    samples = chain[burn::thin].reshape(-1, chain.shape[2])
    ess = walkers * (steps - burn) / tau if np.isfinite(tau) else 0.0
    return Chain(samples, tau, acceptance, status, reason, float(ess), steps)


def _independent(
    proposal: Proposal,
) -> Callable[[FloatArray, np.random.RandomState], tuple[FloatArray, FloatArray]]:
    """emcee's form of a proposal that does not look at where the walker stands."""

    def propose(coords: FloatArray, random: np.random.RandomState) -> tuple[FloatArray, FloatArray]:
        count = len(coords)
        variates = random.random_sample(count), random.standard_normal(coords.shape), random.chisquare(DEGREES, count)
        new = proposal.draw(*variates)
        return new, proposal.log_density(coords) - proposal.log_density(new)

    return propose


def _seed(sampler: Any, rng: np.random.Generator) -> None:
    """Hand the randomness over; emcee hides a state that it could not set, so it is read back."""
    wanted: Any = np.random.RandomState(int(rng.integers(2**32 - 1))).get_state(legacy=True)
    sampler.random_state = wanted
    if not np.array_equal(sampler.random_state[1], wanted[1]):
        raise SamplerError("emcee did not take the random state that it was given; the run would not be repeatable")


def _autocorrelation(chain: FloatArray) -> float:
    """Largest integrated autocorrelation time of (steps, walkers, P), steps, never below 1; NaN if nothing moves.

    A walker that has not moved yet is correlated over the whole chain: emcee divides by its variance.
    """
    package = emcee()

    spread = np.ptp(chain.reshape(-1, chain.shape[2]), axis=0)
    if not (spread > 0.0).all():
        return float("nan")
    if not (np.ptp(chain, axis=0) > 0.0).all():
        return float(len(chain))
    tau = package.autocorr.integrated_time(chain, tol=0, quiet=True)
    return float(max(1.0, np.max(tau)))
