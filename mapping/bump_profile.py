"""Which profile a bump has: a cap, or a bell with a skirt, whichever the trace makes the likelier."""

from __future__ import annotations

import numpy as np

from mapping.evidence import log_evidence
from mapping.problem import Problem, Surroundings
from mapping.spot_problem import spot_problem


def better_profile(cap: Problem, around: Surroundings, rng: np.random.Generator) -> Problem:
    """The problem of the profile with the higher evidence under the noise of the trace.

    Args:
        cap: the posed problem of a bump that no cap fits within that noise.
        around: what it was posed in.
        rng: randomness of the importance sampling.
    """
    bell = spot_problem(cap.feature, around, bell=True)
    cap = cap.under(around.noise)
    evidences = [log_evidence(each, rng) for each in (cap, bell)]
    return bell if evidences[1] > evidences[0] else cap
