"""Evidence: the marginal likelihood of the trace under one family of shapes, its parameters integrated out.

By it a bump's section is chosen: a cap, or a bell with a skirt.
"""

from __future__ import annotations

import numpy as np

from mapping.inference.families import PosteriorProblem, Surroundings, spot_problem, with_free_tip
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


def better_profile(cap: PosteriorProblem, around: Surroundings, rng: np.random.Generator) -> PosteriorProblem | None:
    """The problem of a bell if it has more evidence than a cap under the noise of the trace, else None.

    Args:
        cap: the posed problem of a bump that no cap fits within that noise.
        around: what it was posed in.
        rng: randomness of the importance sampling.
    """
    bell = spot_problem(cap.feature, around, bell=True)
    if around.tip_sd > 0.0:
        bell = with_free_tip(bell, around.tip_sd, around.base.kind != "mesh")
    return bell if log_evidence(bell, rng) > log_evidence(cap.under(around.noise), rng) else None
