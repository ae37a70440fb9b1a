"""Refine: from a detected feature and the trace to its posterior, and to the feature that the draws describe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import EmptyWindowError, Feature, FloatArray, Posterior, Trace
from mapping.base import Base, fit_base
from mapping.inference.evidence import better_section, log_evidence_of_nothing
from mapping.inference.families import PosteriorProblem, Surroundings, with_free_tip, with_nominal_tip
from mapping.inference.kinds import kind_of
from mapping.inference.model_error import account_for_misfit
from mapping.inference.pooled_residual import PooledResidual, pooled_residual, with_remark
from mapping.inference.sampler import (
    TRUSTED_K_HAT,
    Chain,
    Importance,
    find_optima,
    importance_sample,
    laplace,
    resample,
    sample_ensemble,
    walkers_for,
)
from mapping.inference.sections import UNLIKELY_FAMILY, averaged, probabilities
from mapping.inference.summary import describe
from mapping.inference.trace_noise import noise_of_trace
from mapping.instrument import Noise

KEPT_DRAWS = 1000
# The Gaussian approximation of an evidence is taken to be off by no more than this (a PLACEHOLDER; where a
# parameter is bounded by its prior alone)
ROUGH_EVIDENCE = 4.0


@dataclass(frozen=True, eq=False)
class Solution:
    """A posed problem, solved.

    Args:
        problem: as it was finally posed (noise adapted to the misfit, if any).
        posterior: draws and their trustworthiness.
        importance: the fast answer, with its evidence.
        chain: what emcee did, or None if it did not run.
        likely: further families that remain likely, each with its probability over that of this one.
    """

    problem: PosteriorProblem
    posterior: Posterior
    importance: Importance
    chain: Chain | None
    likely: tuple[tuple[float, Solution], ...] = ()


def sample_posterior(
    feature: Feature,
    trace: Trace,
    rng: np.random.Generator,
    *,
    base: Base | None = None,
    noise: Noise | None = None,
    others: Sequence[Feature] = (),
    tip_sd: float = 0.0,
    confirm: bool = True,
) -> Posterior:
    """Draws of a feature's parameters given the trace.

    The optimum, a Laplace approximation and adapted importance sampling give the answer in milliseconds and say by
    k-hat whether it can be trusted; emcee confirms it (theory section 8).

    Args:
        feature: as detected: kind, axis, preliminary height and width.
        trace: the whole trace; only the samples near the feature are used.
        rng: all randomness comes from here: the same state gives the same draws.
        base: the global model; fitted to the trace if None.
        noise: level and correlation of a sample; estimated from the trace if None.
        others: features near by, which the trace also shows (the feature itself may be among them).
        tip_sd: standard deviation of the tip's radius, m; above 0 the radius is a parameter with a Gaussian prior.
        confirm: False to stop at importance sampling where its k-hat is below 0.5.

    Raises:
        MappingError: a kind that has no closed form, or no sample near the feature.
    """
    return solve(feature, trace, rng, base=base, noise=noise, others=others, tip_sd=tip_sd, confirm=confirm).posterior


def refine(
    feature: Feature,
    trace: Trace,
    rng: np.random.Generator,
    *,
    base: Base | None = None,
    noise: Noise | None = None,
    others: Sequence[Feature] = (),
    tip_sd: float = 0.0,
    confirm: bool = True,
) -> Feature:
    """The feature with posterior, intervals and axis from the draws; arguments as for `sample_posterior`.

    Kinds without a closed form (edges) come back as they are, with a note; so does, with no
    evidence, a feature without any sample near it.
    """
    if not kind_of(feature).sampled:
        note = f"no posterior: a {feature.kind} has no closed-form trace"
        return replace(feature, notes=(*feature.notes, note))
    base = base or _fitted(trace)
    noise = noise or noise_of_trace(trace, base)
    try:
        solution = solve(feature, trace, rng, base=base, noise=noise, others=others, tip_sd=tip_sd, confirm=confirm)
    except EmptyWindowError as error:  # one feature without a sample must not cost all others
        nothing = replace(feature.evidence, log_odds=0.0)
        return replace(feature, evidence=nothing, notes=(*feature.notes, f"no posterior: {error}"))
    families = [(share, each.problem, each.posterior) for share, each in [(1.0, solution), *solution.likely]]
    found = averaged(describe(solution.problem, solution.posterior, base), families)
    pooled = _pooled(solution, noise.rounded(trace.resolution))
    found = with_remark(found, pooled, raised=solution.problem.misfit > 0.0)
    odds = odds_against_nothing(solution)
    if solution.problem.misfit > 0.0:  # under noise that was raised to the misfit existence is not judged
        odds = max(odds, pooled.log_odds)
    return replace(found, evidence=replace(found.evidence, log_odds=odds if np.isfinite(odds) else None))


def solve(
    feature: Feature,
    trace: Trace,
    rng: np.random.Generator,
    *,
    base: Base | None = None,
    noise: Noise | None = None,
    others: Sequence[Feature] = (),
    tip_sd: float = 0.0,
    confirm: bool = True,
) -> Solution:
    """Pose and solve a feature's posterior; arguments as for `sample_posterior`."""
    base = base or _fitted(trace)
    noise = (noise or noise_of_trace(trace, base)).rounded(trace.resolution)
    around = Surroundings(trace, base, noise, others, tip_sd)
    solution = solve_problem(pose_problem(feature, around), rng, confirm=confirm)
    solution = _beside_rivals(solution, around, rng, confirm)
    if solution.problem.misfit == 0.0:
        return solution
    better = better_section(solution.problem, around, rng)
    return solution if better is None else solve_problem(better, rng, confirm=confirm)


def _beside_rivals(first: Solution, around: Surroundings, rng: np.random.Generator, confirm: bool) -> Solution:
    """The most probable of a solved problem and its rivals, with those that remain likely beside it.

    All are weighed under the noise of the trace: noise that was raised until one of them fits speaks for none.
    """
    problem, optimum, own = first.problem, _best_draw(first), first.importance.log_evidence
    if problem.misfit > 0.0:
        problem = replace(problem.under(around.noise), misfit=0.0)
        optimum = find_optima(problem.target, optimum[None])[0]
        own = laplace(problem.target, optimum).log_evidence
    nominal = with_nominal_tip(problem)
    kept = [(own, first)]
    for posed in kind_of(problem.feature).rivals(nominal, optimum[: len(nominal.target.shape.names)]):
        rival = with_free_tip(posed, around.tip_sd, around.base.kind != "mesh") if around.tip_sd > 0.0 else posed
        optima = find_optima(rival.target, rival.beginnings)
        roughly = max(laplace(rival.target, each).log_evidence for each in optima)
        if roughly < own + np.log(UNLIKELY_FAMILY) - ROUGH_EVIDENCE:
            continue
        rival = replace(rival, beginnings=np.array(optima))
        fast = importance_sample(rival.target, [laplace(rival.target, each) for each in optima], rng)
        if fast.log_evidence > own + np.log(UNLIKELY_FAMILY):
            kept.append((fast.log_evidence, Solution(rival, _from_importance(rival, fast, rng), fast, None)))
    kept.sort(key=lambda each: -each[0])
    shares = probabilities([evidence for evidence, _ in kept])
    likely = zip(shares[1:] / shares[0], (solved for _, solved in kept[1:]), strict=True)
    best = kept[0][1]
    if best is not first:
        misfit = account_for_misfit(best.problem, [_best_draw(best)])[0].misfit
        if confirm or misfit > 0.0 or best.importance.k_hat >= TRUSTED_K_HAT:
            best = solve_problem(best.problem, rng, confirm=confirm)
    return replace(best, likely=tuple((float(odds), solved) for odds, solved in likely if odds > UNLIKELY_FAMILY))


def _best_draw(solution: Solution) -> FloatArray:
    """The draw (P,) of the highest density."""
    draws = solution.importance.draws
    return np.asarray(draws[int(np.argmax(solution.problem.target.log_density(draws)))])


def _pooled(solution: Solution, noise: Noise) -> PooledResidual:
    """What all crossings together say against the solved family, under the noise of the trace."""
    problem = solution.problem if solution.problem.misfit == 0.0 else solution.problem.under(noise)
    return pooled_residual(problem, find_optima(problem.target, _best_draw(solution)[None])[0])


def settle(feature: Feature, around: Surroundings) -> Feature:
    """The feature at the optimum of its posterior: laid out beside its neighbours, without intervals.

    Kinds without a closed form, and features without a sample near them, come back as they are.
    """
    if not kind_of(feature).sampled:
        return feature
    around = replace(around, noise=around.noise.rounded(around.trace.resolution))
    try:
        problem = pose_problem(feature, around)
    except EmptyWindowError:
        return feature
    best = find_optima(problem.target, problem.beginnings[:1])[0]
    shape, nan = problem.target.shape, float("nan")
    optimum = Posterior(shape.names, shape.units, best[None], nan, nan, "not needed", "only the optimum was asked for")
    return describe(problem, optimum, around.base)


def odds_against_nothing(solution: Solution) -> float:
    """Log Bayes factor of a solved feature against the bare base (with the neighbours that it was posed with)."""
    return solution.importance.log_evidence - log_evidence_of_nothing(solution.problem.target)


def pose_problem(feature: Feature, around: Surroundings) -> PosteriorProblem:
    """The posterior density of a feature of any kind that has a closed form.

    Raises:
        MappingError: a kind without one.
    """
    problem = kind_of(feature).problem(feature, around)
    base_was_felt = around.base.kind != "mesh"
    return with_free_tip(problem, around.tip_sd, base_was_felt) if around.tip_sd > 0.0 else problem


def solve_problem(
    problem: PosteriorProblem, rng: np.random.Generator, *, confirm: bool = True, adapt: bool = True
) -> Solution:
    """Optimum, misfit (unless `adapt` is False: the noise is known), importance sampling, and emcee where needed."""
    optima = find_optima(problem.target, problem.beginnings)
    if adapt:
        problem, optima = account_for_misfit(problem, optima)
    fast = importance_sample(problem.target, [laplace(problem.target, optimum) for optimum in optima], rng)
    if not confirm and fast.k_hat < TRUSTED_K_HAT:
        return Solution(problem, _from_importance(problem, fast, rng), fast, None)
    walkers = walkers_for(len(problem.window), fast.draws.shape[1])
    starts = _starts(problem, fast, rng, walkers)
    chain = sample_ensemble(problem.target, starts, rng, proposal=fast.proposal)
    return Solution(problem, _from_chain(problem, fast, chain, rng), fast, chain)


def _starts(problem: PosteriorProblem, fast: Importance, rng: np.random.Generator, walkers: int) -> FloatArray:
    """Walkers at weighted draws, pulled apart a little so that no two coincide."""
    target = problem.target
    starts = fast.draws[resample(rng, fast.weights, walkers)]
    jitter = 0.1 * (fast.draws[rng.permutation(len(fast.draws))[:walkers]] - fast.weights @ fast.draws)
    moved = np.clip(starts + jitter, target.low, target.high)
    sound = np.isfinite(target.log_density(moved))
    return np.where(sound[:, None], moved, starts)


def _from_importance(problem: PosteriorProblem, fast: Importance, rng: np.random.Generator) -> Posterior:
    shape = problem.target.shape
    samples = fast.draws[resample(rng, fast.weights, KEPT_DRAWS)]
    reason = f"importance sampling of the Laplace approximation has k-hat {fast.k_hat:.2f} < {TRUSTED_K_HAT}"
    nan = float("nan")
    return Posterior(shape.names, shape.units, samples, nan, nan, "not needed", reason, fast.k_hat, fast.ess)


def _from_chain(problem: PosteriorProblem, fast: Importance, chain: Chain, rng: np.random.Generator) -> Posterior:
    shape = problem.target.shape
    samples = chain.samples
    if len(samples) > 4 * KEPT_DRAWS:
        samples = samples[np.sort(rng.permutation(len(samples))[: 4 * KEPT_DRAWS])]
    return Posterior(
        shape.names,
        shape.units,
        samples,
        chain.tau,
        chain.acceptance,
        chain.status,
        chain.reason,
        fast.k_hat,
        chain.ess,
    )


def _fitted(trace: Trace) -> Base:
    return fit_base(trace)
