"""Place and height of one known shape on a sweep, by generalised least squares with its closed-form trace."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mapping import FloatArray
from mapping.geometry.templates import cap_height
from mapping.instrument import Noise

# |Height| of a trace at offsets x from the shape's place, for a crest of a given |height|, m
Shape = Callable[[FloatArray, float], FloatArray]

# Bins that a sweep is averaged over; every shape is wider than many of them
SHAPE_FIT_BINS = 160
STARTS = 81
# Samples that a sweep must have to be fitted: two in each of the fewest bins. A sweep of pecks has 25
FEWEST_FIT_BINS, FEWEST_FITTED = 8, 16
# Relative change of place, height and chi-squared below which a fit has converged: far below its uncertainty
FIT_TOLERANCE = 1e-6


@dataclass(frozen=True)
class ShapeFit:
    """A shape at arclength `place` with standard deviation `sd`, of signed `height` with `height_sd`; m.

    `gain` is the fall of chi-squared against the bare base.
    """

    place: float
    sd: float
    height: float
    height_sd: float
    gain: float


def fit_shape(
    s: FloatArray,
    height: FloatArray,
    shape: Shape,
    sign: float,
    crest: float,
    within: tuple[float, float],
    noise: Noise,
    *,
    crest_sd: float = np.inf,
) -> ShapeFit:
    """The best place within an interval and the best height.

    Args:
        s: (N,) arclengths, m, increasing; N >= FEWEST_FITTED.
        height: (N,) heights of the trace over the base's, m.
        shape: the closed form.
        sign: +1 for crests, -1 for dips.
        crest: preliminary |height|, m.
        within: interval of possible places, m.
        noise: of the samples.
        crest_sd: standard deviation of `crest` if it is known from elsewhere, m.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import least_squares

    place, mean, samples = means_in_bins(s, height)
    root = np.linalg.cholesky(covariance_of_means(place, samples, noise))

    def whitened(values: FloatArray) -> FloatArray:
        return np.asarray(solve_triangular(root, values, lower=True, check_finite=False))

    data = whitened(sign * mean)

    def residual(p: FloatArray) -> FloatArray:
        misfit = whitened(shape(place - p[0], max(float(p[1]), 0.0))) - data
        return np.append(misfit, (p[1] - crest) / crest_sd)

    starts = np.linspace(*within, STARTS)
    templates = whitened(np.stack([shape(place - start, crest) for start in starts], axis=1))
    first = starts[int(((templates - data[:, None]) ** 2).sum(axis=0).argmin())]
    bounds = ([within[0], 0.0], [within[1], 3.0 * crest])
    step = max(0.01 * (within[1] - within[0]), np.finfo(float).tiny)
    start = [float(np.clip(first, within[0] + 0.1 * step, within[1] - 0.1 * step)), crest]
    fit = least_squares(
        residual, start, bounds=bounds, x_scale=[step, crest], ftol=FIT_TOLERANCE, xtol=FIT_TOLERANCE, max_nfev=40
    )
    jacobian = np.asarray(fit.jac)
    variance = np.diag(np.linalg.pinv(jacobian.T @ jacobian))
    sd, height_sd = (float(np.sqrt(v)) if v > 0 else np.inf for v in variance)
    gain = float(data @ data - 2.0 * fit.cost)
    return ShapeFit(float(fit.x[0]), sd, sign * float(fit.x[1]), height_sd, gain)


def crest_shape(cap: float, tip_radius: float) -> Shape:
    """A ridge's round crest of radius `cap` (m), crossed squarely."""
    return lambda x, h: cap_height(x, h, cap, tip_radius)


def dip_shape(tip_radius: float) -> Shape:
    """A groove's dip between its two rims, crossed squarely (theory section 4)."""
    return lambda x, h: np.maximum(np.sqrt(2.0 * tip_radius * h) - np.abs(x), 0.0) ** 2 / (2.0 * tip_radius)


def end_shape(sign: float, tip_radius: float) -> Shape:
    """A crest that runs from x < 0 and ends at x = 0 in a round cap; a groove that ends at an edge."""
    return lambda x, h: end_heights(x, np.zeros_like(x), h, sign, tip_radius)


def end_heights(u: FloatArray, v: FloatArray, crest: float, sign: float, tip_radius: float) -> FloatArray:
    """|Height| at (u, v) of a thin line along v = 0 that runs from u < 0 and ends at u = 0, m.

    Of a ridge the ball rides over the cap at its end. Over a slot it sinks by d^2 / (2 r) between the edges that hold
    it, d from the nearest one.
    """
    if sign > 0:
        return cap_height(np.hypot(np.maximum(u, 0.0), v), crest, 0.5 * crest, tip_radius)
    inside = np.minimum(np.maximum(-u, 0.0), np.maximum(np.sqrt(2.0 * tip_radius * crest) - np.abs(v), 0.0))
    return np.asarray(inside**2 / (2.0 * tip_radius))


def edge_shape(tip_radius: float) -> Shape:
    """A step seen from its high side: a plateau at x < 0 that ends at a sharp edge."""
    return lambda x, h: cap_height(np.maximum(x, 0.0), h, 0.0, tip_radius)


def means_in_bins(s: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means of place and height in at most SHAPE_FIT_BINS bins of equal length, m, and the samples in each."""
    count = int(min(SHAPE_FIT_BINS, max(FEWEST_FIT_BINS, len(s) // 4)))
    cell = np.clip(((s - s[0]) / (s[-1] - s[0]) * count).astype(int), 0, count - 1)
    samples = np.bincount(cell, minlength=count).astype(float)
    used = samples > 0
    sums = [np.bincount(cell, weights=values, minlength=count)[used] for values in (s, height)]
    return sums[0] / samples[used], sums[1] / samples[used], samples[used]


def covariance_of_means(place: FloatArray, samples: FloatArray, noise: Noise) -> FloatArray:
    """(B, B) of means over so many samples (B,) at places (B,), m: m^2."""
    correlated = replace(noise, white=0.0).covariance(place)
    # a noise-free trace still carries rounding, and the shapes are not exact
    floor = 1e-12 * float(np.ptp(place)) ** 2
    return np.asarray(correlated + np.diag(noise.white**2 / samples + floor))
