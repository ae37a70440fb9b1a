"""Evidence: how probable the trace is under one family of shapes, its parameters integrated out."""

from __future__ import annotations

import numpy as np

from mapping.importance import importance_sample
from mapping.laplace import find_optima, laplace
from mapping.problem import Problem
from mapping.target import Target


def log_evidence(problem: Problem, rng: np.random.Generator) -> float:
    """Log of the integral of likelihood and prior over the parameters, by importance sampling.

    A prior wider than the data need costs what it should (Occam's factor). Evidences compare between problems that
    have the same window, noise and nuisance.
    """
    optima = find_optima(problem.target, problem.beginnings)
    return importance_sample(problem.target, [laplace(problem.target, each) for each in optima], rng).log_evidence


def log_evidence_of_nothing(target: Target) -> float:
    """The same where only the base, and neighbours that the target knows of, left the trace."""
    bare = np.zeros((1, len(target.likelihood.window))) if target.beside is None else target.beside[None]
    return float(target.likelihood.log_density(bare)[0])
