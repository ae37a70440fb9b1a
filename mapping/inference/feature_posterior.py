"""Refine: from a detected feature and the trace to its posterior, and to the feature that the draws describe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapping import CourseError, EmptyWindowError, Feature, FloatArray, Posterior, Trace
from mapping.base import Base, fit_base
from mapping.inference.evidence import (
    ROUGH_EVIDENCE,
    UNLIKELY_FAMILY,
    at_optima,
    averaged,
    better_section,
    log_evidence_of_nothing,
    probabilities,
    roughly_weighed,
)
from mapping.inference.families import (
    PosteriorProblem,
    Surroundings,
    with_free_tip,
    with_nominal_tip,
    with_worn_tip,
)
from mapping.inference.kinds import kind_of
from mapping.inference.likelihood import Shape
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
    steps_for,
    walkers_for,
)
from mapping.inference.summary import describe, described_at, with_ends_of_all
from mapping.inference.trace_noise import noise_of_trace
from mapping.instrument import Noise

KEPT_DRAWS = 1000
# Draws of which the best begins the search for the optimum
FEW_BEGINNINGS = 200

# A posterior that holds the neighbours, made one that does not
Widened = Callable[[PosteriorProblem, Posterior, np.random.Generator], Posterior]


@dataclass(frozen=True, eq=False)
class Solution:
    """A posed problem, solved.

    Args:
        problem: as it was finally posed (noise adapted to the misfit, if any).
        posterior: draws and their trustworthiness.
        importance: the fast answer, with its evidence.
        chain: what emcee did, or None if it did not run.
        likely: further families that remain likely, each with its probability over that of this one.
        pooled: what all crossings together say against it under the noise of the trace; None: nobody asked yet.
    """

    problem: PosteriorProblem
    posterior: Posterior
    importance: Importance
    chain: Chain | None
    likely: tuple[tuple[float, Solution], ...] = ()
    pooled: PooledResidual | None = None


def sample_posterior(
    feature: Feature,
    trace: Trace,
    rng: np.random.Generator,
    *,
    base: Base | None = None,
    noise: Noise | None = None,
    others: Sequence[Feature] = (),
    tip_sd: float = 0.0,
    confirm: bool | None = True,
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
        confirm: False to stop at importance sampling where its k-hat is below 0.5; None to stop there in any case:
            the posterior's status then says where it cannot be trusted.

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
    confirm: bool | None = True,
    widened: Widened | None = None,
) -> Feature:
    """The feature with posterior, intervals and axis from the draws; arguments as for `sample_posterior`, and what
    makes draws of such that hold the others: None, these are known.

    Kinds without a closed form (edges) come back as they are, with a note; so do a line whose course does not lie over
    the base and, with no evidence, a feature without any sample near it.
    """
    if not kind_of(feature).sampled:
        note = f"no posterior: a {feature.kind} has no closed-form trace"
        return replace(feature, notes=(*feature.notes, note))
    base = base or _fitted(trace)
    noise = noise or noise_of_trace(trace, base)
    try:
        solution = solve(feature, trace, rng, base=base, noise=noise, others=others, tip_sd=tip_sd, confirm=confirm)
    except CourseError as error:  # nothing was asked of the trace: what single sweeps showed of it stands
        remark = f"its sizes are those that single sweeps show, for {error}"
        details = replace(feature.details, misfit=remark)
        return replace(feature, details=details, notes=(*feature.notes, f"no posterior: {error}"))
    except EmptyWindowError as error:  # one feature without a sample must not cost all others
        nothing = replace(feature.evidence, log_odds=0.0)
        return replace(feature, evidence=nothing, notes=(*feature.notes, f"no posterior: {error}"))
    families = [(share, each.problem, each.posterior) for share, each in [(1.0, solution), *solution.likely]]
    if widened is not None:
        families = [(share, problem, widened(problem, posterior, rng)) for share, problem, posterior in families]
    found = with_ends_of_all(averaged(describe(solution.problem, families[0][2], base), families), families)
    pooled = solution.pooled or _pooled(solution, noise.rounded(trace.resolution))
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
    confirm: bool | None = True,
) -> Solution:
    """Pose and solve a feature's posterior; arguments as for `sample_posterior`."""
    base = base or _fitted(trace)
    noise = (noise or noise_of_trace(trace, base)).rounded(trace.resolution)
    around = Surroundings(trace, base, noise, others, tip_sd)
    problems = _rough(pose_problem(feature, around), around)
    first, optima = account_for_misfit(problems[0], list(problems[0].beginnings))
    first = replace(first, beginnings=np.array(optima))
    found = None
    if first.misfit == 0.0:
        found = _likeliest([first, *problems[1:]], rng, confirm)
        pooled = _pooled(found, noise)
        found = replace(found, pooled=pooled)
        if not pooled.remarked(feature.height.median):
            return found
    # None of them fits: what the others would say is no better founded
    better = better_section(first, around, rng)
    if better is not None:
        return solve_problem(better, rng, confirm=confirm, noise=noise)
    return solve_problem(first, rng, confirm=confirm, adapt=False, noise=noise) if found is None else found


def _rough(first: PosteriorProblem, around: Surroundings) -> list[PosteriorProblem]:
    """The problem and its rivals, as far as they may be likely by the Laplace approximation; the likeliest first.

    All are weighed under the noise of the trace: noise that is raised until one of them fits would speak for none.
    """
    first = at_optima(first)
    nominal = with_nominal_tip(first)
    kind = kind_of(first.feature)
    rivals = [*kind.rivals(nominal, first.beginnings[0, : len(nominal.target.shape.names)])]
    if around.base.offset < 0.0 and first.feature.height.median > 0.0 and not kind.sided:
        # what stands the ball too low on the ground may be worn off it, and is then missing on every crest
        worn = [with_worn_tip(each, -around.base.offset) for each in (nominal, *rivals)]
    else:
        worn = []
    if not rivals and not worn:
        return [first]
    families = roughly_weighed((first, *(_felt(each, around) for each in rivals), *worn))
    weighed = sorted(families, key=lambda each: -each[0])
    least = weighed[0][0] + np.log(UNLIKELY_FAMILY) - ROUGH_EVIDENCE
    return [problem for evidence, problem in weighed if evidence > least]


def _felt(problem: PosteriorProblem, around: Surroundings) -> PosteriorProblem:
    """The problem with the tip's radius as a parameter, if that is doubtful."""
    return with_free_tip(problem, around.tip_sd, around.base.level_was_felt) if around.tip_sd > 0.0 else problem


def _likeliest(problems: Sequence[PosteriorProblem], rng: np.random.Generator, confirm: bool | None) -> Solution:
    """The most probable of some problems on one window, solved, with those that remain likely beside it.

    The first of them begins at its optima, under the noise that it was left with.
    """
    best = solve_problem(problems[0], rng, confirm=confirm, adapt=False)
    solved, weights = [best], [_log_weight(best)]
    for problem in problems[1:]:
        target = problem.target.with_likelihood(best.problem.target.likelihood)
        modes = [laplace(target, optimum) for optimum in find_optima(target, problem.beginnings)]
        # what is surely unlikely beside the likeliest so far need not be known better; a plain member tells by draws
        plain = kind_of(problem.feature).has_plain_member(with_nominal_tip(problem).target.shape)
        least = -np.inf if plain else max(weights) + float(np.log(UNLIKELY_FAMILY))
        fast, rival = importance_sample(target, modes, rng, least), replace(problem, target=target)
        solved.append(Solution(rival, _from_importance(rival, fast, rng), fast, None))
        weights.append(_log_weight(solved[-1]))
    shares = probabilities(weights)
    unlikely = shares <= UNLIKELY_FAMILY * shares.max()
    more = np.array([kind_of(each.problem.feature).claims_more(_nominal(each)) for each in solved])
    order = [int(k) for k in np.lexsort((-shares, more, unlikely))]
    first = solved[order[0]]
    if first is not best and confirm is not None and (confirm or first.importance.k_hat >= TRUSTED_K_HAT):
        first = solve_problem(first.problem, rng, confirm=confirm, adapt=False)
    likely = [(float(shares[k] / shares[order[0]]), solved[k]) for k in order[1:] if not unlikely[k]]
    return replace(first, likely=tuple(likely))


def _log_weight(solution: Solution) -> float:
    """Log evidence of a solved family and of its plainest member, which are equally probable beforehand."""
    return solution.importance.log_evidence + float(np.log1p(_plain_odds(solution)))


def _plain_odds(solution: Solution) -> float:
    """Bayes factor of the plainest member of a solved family against all of it."""
    shape = _nominal(solution)
    return kind_of(solution.problem.feature).plain_odds(shape, solution.posterior.samples[:, : len(shape.names)])


def _nominal(solution: Solution) -> Shape:
    """The family as the nominal tip feels it."""
    return with_nominal_tip(solution.problem).target.shape


def _pooled(solution: Solution, noise: Noise) -> PooledResidual:
    """What all crossings together say against the solved family, under the noise of the trace."""
    return _pooled_by(solution.problem, solution.importance, noise)


def _pooled_by(problem: PosteriorProblem, importance: Importance, noise: Noise) -> PooledResidual:
    problem = problem if problem.misfit == 0.0 else problem.under(noise)
    draws = importance.draws[:: max(1, len(importance.draws) // FEW_BEGINNINGS)]
    begin = draws[int(np.argmax(problem.target.log_density(draws)))]
    return pooled_residual(problem, find_optima(problem.target, begin[None])[0])


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
    return described_at(find_optima(problem.target, problem.beginnings[:1])[0], problem, around.base)


def odds_against_nothing(solution: Solution) -> float:
    """Log Bayes factor of a solved feature against the bare base (with the neighbours that it was posed with)."""
    return _log_odds(solution.problem, solution.importance)


def _log_odds(problem: PosteriorProblem, importance: Importance) -> float:
    return importance.log_evidence - log_evidence_of_nothing(problem.target)


def _hardly_spoken_for(problem: PosteriorProblem, importance: Importance, pooled: PooledResidual | None) -> bool:
    """True of what the evidence makes a false alarm: it is not told, and nobody asks how well its draws are known.

    Under noise that was raised to the misfit existence is judged by what all crossings together show, if that is known.
    """
    if problem.misfit > 0.0 and pooled is None:
        return False
    odds = max(_log_odds(problem, importance), -np.inf if pooled is None else pooled.log_odds)
    return not replace(problem.feature.evidence, log_odds=odds).likely


def pose_problem(feature: Feature, around: Surroundings) -> PosteriorProblem:
    """The posterior density of a feature of any kind that has a closed form.

    Raises:
        MappingError: a kind without one.
    """
    problem = kind_of(feature).problem(feature, around)
    base_was_felt = around.base.level_was_felt
    return with_free_tip(problem, around.tip_sd, base_was_felt) if around.tip_sd > 0.0 else problem


def solve_problem(
    problem: PosteriorProblem,
    rng: np.random.Generator,
    *,
    confirm: bool | None = True,
    adapt: bool = True,
    noise: Noise | None = None,
) -> Solution:
    """Optimum, misfit (unless `adapt` is False: the noise is known), importance sampling, and emcee where needed.

    Unless it is asked for, no chain confirms what the evidence makes a false alarm; of what no ideal shape fits that is
    known under the noise of the trace, if it is given.
    """
    optima = find_optima(problem.target, problem.beginnings)
    if adapt:
        problem, optima = account_for_misfit(problem, optima)
    fast = importance_sample(problem.target, [laplace(problem.target, optimum) for optimum in optima], rng)
    enough, pooled = fast.k_hat < TRUSTED_K_HAT, None
    if confirm is False and not enough:
        pooled = _pooled_by(problem, fast, noise) if noise is not None and problem.misfit > 0.0 else None
        enough = _hardly_spoken_for(problem, fast, pooled)
    if confirm is None or (not confirm and enough):
        return Solution(problem, _from_importance(problem, fast, rng), fast, None, pooled=pooled)
    walkers = walkers_for(len(problem.window), fast.draws.shape[1])
    starts = _starts(problem, fast, rng, walkers)
    steps = steps_for(len(problem.window), walkers)
    chain = sample_ensemble(problem.target, starts, rng, proposal=fast.proposal, max_steps=steps)
    return Solution(problem, _from_chain(problem, fast, chain, rng), fast, chain, pooled=pooled)


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
    trusted, nan = fast.k_hat < TRUSTED_K_HAT, float("nan")
    reason = f"importance sampling of the Laplace approximation has k-hat {fast.k_hat:.2f}"
    reason += f" < {TRUSTED_K_HAT}" if trusted else f", at most {TRUSTED_K_HAT} can be trusted; no chain was asked for"
    status = "not needed" if trusted else "chain too short"
    return Posterior(shape.names, shape.units, samples, nan, nan, status, reason, fast.k_hat, fast.ess)


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
