"""Evidence: the marginal likelihood of the trace under one family of shapes, its parameters integrated out.

By it a section is chosen: of a bump a cap, or a bell with a skirt.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping.inference.families import PosteriorProblem, Surroundings, with_free_tip
from mapping.inference.kinds import kind_of
from mapping.inference.likelihood import LogPosterior
from mapping.inference.sampler import find_optima, importance_sample, laplace

# The Gaussian approximation of a log evidence was off by -2.0 to +2.9 (33 families of 11 lines of explore3d bench
# sections --building): what it takes for less likely by more than both of these is
ROUGH_EVIDENCE = 5.0


def log_evidence(problem: PosteriorProblem, rng: np.random.Generator) -> float:
    """Log of the integral of likelihood and prior over the parameters, by importance sampling.

    A prior wider than the data need costs what it should (Occam's factor). Evidences compare between problems that
    have the same window, noise and nuisance.
    """
    optima = find_optima(problem.target, problem.beginnings)
    return importance_sample(problem.target, [laplace(problem.target, each) for each in optima], rng).log_evidence


def log_evidence_of_nothing(target: LogPosterior) -> float:
    """The same where only the base, and neighbours that the target knows of, left the trace."""
    bare = np.zeros((1, len(target.likelihood.window))) if target.beside is None else target.beside[None]
    return float(target.likelihood.log_density(bare)[0])


def at_optima(problem: PosteriorProblem) -> PosteriorProblem:
    """The problem that begins where its searches end."""
    return replace(problem, beginnings=np.array(find_optima(problem.target, problem.beginnings)))


def rough_evidence(problem: PosteriorProblem) -> float:
    """The Gaussian approximation of the log evidence of a problem that begins at its optima."""
    return max(laplace(problem.target, optimum).log_evidence for optimum in problem.beginnings)


def better_section(first: PosteriorProblem, around: Surroundings, rng: np.random.Generator) -> PosteriorProblem | None:
    """The alternative of a kind that has more evidence than its first family under the noise of the trace, else None.

    Args:
        first: the posed problem of a feature that the first family does not fit within that noise.
        around: what it was posed in.
        rng: randomness of the importance sampling, of those whose Gaussian approximations do not decide.
    """
    posed = kind_of(first.feature).alternatives(first.feature, around)
    if not posed:
        return None
    if around.tip_sd > 0.0:
        posed = [with_free_tip(each, around.tip_sd, around.base.kind != "mesh") for each in posed]
    families = [at_optima(each) for each in (first.under(around.noise), *posed)]
    evidence = [rough_evidence(each) for each in families]
    likely = [k for k, each in enumerate(evidence) if each > max(evidence) - ROUGH_EVIDENCE]
    if len(likely) > 1:
        likely.sort(key=lambda k: -log_evidence(families[k], rng))
    return families[likely[0]] if likely[0] > 0 else None
