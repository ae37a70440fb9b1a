"""Kind odds: log Bayes factor between a bump and a ridge, on the same samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapping.base import Base
from mapping.bump_shape import spot_at
from mapping.feature import Feature
from mapping.noise import Noise
from mapping.problem import Surroundings
from mapping.refine import pose_problem, solve_problem
from mapping.spot_problem import bump_shape
from mapping.target import Target
from mapping.trace import Trace


def bump_or_ridge(
    feature: Feature,
    trace: Trace,
    rng: np.random.Generator,
    *,
    base: Base,
    noise: Noise,
    others: Sequence[Feature] = (),
) -> float:
    """Log Bayes factor of a ridge against a round bump; positive where the ridge is the likelier.

    Both are asked about the samples near the ridge, with the same priors of height and section.

    Args:
        feature: a bump or ridge as detected; the other arguments as for `refine`.
    """
    around = Surroundings(trace, base, noise, [other for other in others if other is not feature])
    ridge = pose_problem(replace(feature, kind="ridge"), around)
    middle = len(feature.axis) // 2
    point, normal = feature.axis[middle], feature.normals[middle]
    tip = trace.tip_radius
    nearest = int(np.argmin(np.linalg.norm(ridge.window.feet - point, axis=1)))
    along = ridge.window.tangents[nearest]
    spot = spot_at(point, normal, along, base, tip, ridge.sizes.half_width)
    shape = bump_shape(ridge.window, spot, ridge.sizes, tip, 2)
    likelihood, beside = ridge.target.likelihood, ridge.target.beside
    bump = replace(ridge, target=Target(shape, likelihood, beside), beginnings=shape.start[None])
    evidences = [solve_problem(each, rng, confirm=False, adapt=False).importance.log_evidence for each in (ridge, bump)]
    return evidences[0] - evidences[1]
