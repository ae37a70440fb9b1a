"""Kind odds: the problem of another kind of feature on the same samples, to compare by log evidence.

The difference of two log evidences under the same noise, window and nuisance is the log Bayes factor. With equal odds
beforehand the probability of the first is 1 / (1 + exp(-log odds)); `explore3d bench odds` checks that such
probabilities come true.

Reference: theory section 8.4.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapping import Feature, MappingError
from mapping.inference.families import BrokenRidgeShape, PosteriorProblem, RidgeShape, Surroundings, spot_at
from mapping.inference.kinds import bump_shape
from mapping.inference.likelihood import LogPosterior
from mapping.inference.sampler import find_optima


def as_bump(ridge: PosteriorProblem, feature: Feature, around: Surroundings) -> PosteriorProblem:
    """The problem of a bump on the samples of a ridge's problem."""
    middle = len(feature.axis) // 2
    point, normal = feature.axis[middle], feature.normals[middle]
    tip = around.trace.tip_radius
    nearest = int(np.argmin(np.linalg.norm(ridge.window.feet - point, axis=1)))
    spot = spot_at(point, normal, ridge.window.tangents[nearest], around.base, tip, ridge.sizes.half_width)
    shape = bump_shape(ridge.window, spot, ridge.sizes, tip, 2)
    shifts = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]) * ridge.sizes.half_width
    beginnings = np.tile(shape.start, (len(shifts), 1))
    beginnings[:, :2] += shifts
    return replace(
        ridge, target=LogPosterior(shape, ridge.target.likelihood, ridge.target.beside), beginnings=beginnings
    )


def as_broken(ridge: PosteriorProblem) -> PosteriorProblem:
    """The problem of two ridges in line, with a gap between them, on the samples of one ridge's problem.

    Raises:
        MappingError: a problem that is not of an open ridge.
    """
    whole = ridge.target.shape
    if not isinstance(whole, RidgeShape) or whole.chart.closed:
        raise MappingError("only an open ridge can be two ridges in line")
    shape = BrokenRidgeShape(whole, ridge.sizes.half_width)
    target = LogPosterior(shape, ridge.target.likelihood, ridge.target.beside)
    unbroken = find_optima(ridge.target, ridge.beginnings)[0]
    low, high = unbroken[-4], unbroken[-3]
    # Gaps all along the ridge, and beyond its ends, where they leave it whole.
    beyond = 0.5 * (target.low[0] + low), 0.5 * (high + target.high[0])
    middles = [*(low + share * (high - low) for share in np.linspace(0.05, 0.95, 13)), *beyond]
    gaps = np.array([(middle, np.log(width * ridge.sizes.half_width)) for middle in middles for width in (0.4, 2.0)])
    beginnings = np.column_stack([gaps, np.tile(unbroken, (len(gaps), 1))])
    beginnings = np.clip(beginnings, target.low, target.high)
    inside = beginnings[:-4][np.argsort(-target.log_density(beginnings[:-4]))[:4]]
    return replace(ridge, target=target, beginnings=np.concatenate([inside, beginnings[-4::2]]))
