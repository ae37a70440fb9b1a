"""Evidence: the marginal likelihood of the trace under one family of shapes, its parameters integrated out.

By it a section is chosen: of a bump a cap, or a bell with a skirt.
"""

from __future__ import annotations

import numpy as np

from mapping.inference.families import PosteriorProblem, Surroundings, with_free_tip
from mapping.inference.kinds import kind_of
from mapping.inference.likelihood import LogPosterior
from mapping.inference.sampler import find_optima, importance_sample, laplace


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


def better_section(first: PosteriorProblem, around: Surroundings, rng: np.random.Generator) -> PosteriorProblem | None:
    """The alternative of a kind that has more evidence than its first family under the noise of the trace, else None.

    Args:
        first: the posed problem of a feature that the first family does not fit within that noise.
        around: what it was posed in.
        rng: randomness of the importance sampling.
    """
    best: tuple[float, PosteriorProblem] | None = None
    for posed in kind_of(first.feature).alternatives(first.feature, around):
        other = with_free_tip(posed, around.tip_sd, around.base.kind != "mesh") if around.tip_sd > 0.0 else posed
        evidence = log_evidence(other, rng)
        if best is None or evidence > best[0]:
            best = evidence, other
    return best[1] if best is not None and best[0] > log_evidence(first.under(around.noise), rng) else None
