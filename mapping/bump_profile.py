"""Which profile a bump has: a cap, or a bell with a skirt, whichever the trace makes the likelier."""

from __future__ import annotations

import numpy as np

from mapping.evidence import log_evidence
from mapping.free_tip_shape import with_free_tip
from mapping.problem import Problem, Surroundings
from mapping.spot_problem import spot_problem


def better_profile(cap: Problem, around: Surroundings, rng: np.random.Generator) -> Problem | None:
    """The problem of a bell if it has more evidence than a cap under the noise of the trace, else None.

    Args:
        cap: the posed problem of a bump that no cap fits within that noise.
        around: what it was posed in.
        rng: randomness of the importance sampling.
    """
    bell = spot_problem(cap.feature, around, bell=True)
    if around.tip_sd > 0.0:
        bell = with_free_tip(bell, around.tip_sd)
    return bell if log_evidence(bell, rng) > log_evidence(cap.under(around.noise), rng) else None
