"""Presence: is a line of which much is known there, or nothing? One log odds of passes over one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.instrument import Noise
from planners.follow.template_fit import Shape, covariance_of_means, means_in_bins

# Places and heights that a line may have there: so many standard deviations about what is expected, places no farther
# apart, in half-widths, than what passes tell that show it
PRIOR_REACH_SDS, STEP_BETWEEN_PLACES, PLACES_TRIED, HEIGHTS_TRIED = 3.0, 0.1, 21, 11


@dataclass(frozen=True)
class Expected:
    """What is known of a line beforehand, of Gaussian laws.

    Args:
        place, place_sd: where it is along the sweep, m.
        log_height, log_height_sd: of its |height|, ln m.
    """

    place: float
    place_sd: float
    log_height: float
    log_height_sd: float


def presence(
    s: FloatArray, height: FloatArray, shape: Shape, sign: float, expected: Expected, half_width: float, noise: Noise
) -> tuple[float, Expected]:
    """Log Bayes factor of a line as it is expected against the bare base, and what is known of it if it is there.

    Place and height are marginalised over their laws; what is then known of them is told by two moments each (assumed
    density filtering; Maybeck, Stochastic Models, Estimation and Control 2, 1982, section 12.7).

    Args:
        s: (N,) arclengths of the samples of all passes, m, increasing; N >= FEWEST_FITTED.
        height: (N,) heights of the trace over the base's, m.
        shape: the closed form.
        sign: +1 for crests, -1 for dips.
        half_width: of the disturbance, m.
        noise: of the samples.
    """
    from scipy.linalg import solve_triangular

    place, mean, samples = means_in_bins(s, height)
    root = np.linalg.cholesky(covariance_of_means(place, samples, noise))
    count = max(
        PLACES_TRIED, int(np.ceil(2.0 * PRIOR_REACH_SDS * expected.place_sd / (STEP_BETWEEN_PLACES * half_width)))
    )
    z, y = (
        np.linspace(-PRIOR_REACH_SDS, PRIOR_REACH_SDS, count),
        np.linspace(-PRIOR_REACH_SDS, PRIOR_REACH_SDS, HEIGHTS_TRIED),
    )
    places = expected.place + expected.place_sd * z
    log_heights = expected.log_height + expected.log_height_sd * y
    templates = [shape(place - at, float(np.exp(log_height))) for at in places for log_height in log_heights]
    columns = np.column_stack([sign * mean, *templates])
    white = solve_triangular(root, columns, lower=True, check_finite=False)
    data, white = white[:, 0], white[:, 1:]
    match = (data @ white - 0.5 * (white**2).sum(axis=0)).reshape(count, HEIGHTS_TRIED)
    prior = -0.5 * (z[:, None] ** 2 + y**2)
    prior -= np.log(np.exp(prior).sum())
    top = float((match + prior).max())
    weight = np.exp(match + prior - top)
    odds = top + float(np.log(weight.sum()))
    weight /= weight.sum()
    return odds, Expected(*_moments(places, weight.sum(axis=1)), *_moments(log_heights, weight.sum(axis=0)))


def _moments(values: FloatArray, weight: FloatArray) -> tuple[float, float]:
    mean = float(weight @ values)
    return mean, float(np.sqrt(weight @ (values - mean) ** 2))
