"""Where a ridge or groove ends, from a sweep that slides along its crest and off the end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.noise import Noise
from mapping.shapes import cap_height

FloatArray = NDArray[np.float64]

# Bins that a slide is averaged over; the end's shape is wider than many of them
BINS = 160


@dataclass(frozen=True)
class EndFit:
    """An end at arclength `place` (m) with standard deviation `sd`, on a crest of signed `height` (m).

    `found` is False if the crest does not fall off within the sweep.
    """

    place: float
    sd: float
    height: float
    found: bool


def fit_end(
    s: FloatArray,
    height: FloatArray,
    sign: float,
    crest: float,
    tip_radius: float,
    noise: Noise,
    cap: float | None = None,
) -> EndFit:
    """Generalised least squares for the end and the height of a crest that runs towards growing s.

    A convex crest's end is a round cap as wide as it is high; a concave one's an edge that lifts the ball
    (theory section 4).

    Args:
        s: (N,) arclengths, m, increasing.
        height: (N,) heights of the trace over the base's, m.
        sign: +1 ridge, -1 groove.
        crest: preliminary |height|, m.
        noise: of the samples.
        cap: radius of the round cap at a convex crest's end, m; None: half of its height.
    """
    from scipy.optimize import least_squares

    place, mean, samples = _binned(s, height)
    chol = np.linalg.cholesky(_covariance(place, samples, noise))
    white = np.linalg.solve(chol, sign * mean)

    def residual(p: FloatArray) -> FloatArray:
        model = end_trace(place - p[0], max(p[1], 0.0), sign, tip_radius, cap)
        return np.asarray(np.linalg.solve(chol, model) - white)

    grid = np.linspace(place[0], place[-1], 80)
    start = min(grid, key=lambda end: float((residual(np.array([end, crest])) ** 2).sum()))
    fit = least_squares(residual, [start, crest], x_scale=[tip_radius * 0.1, crest])
    end, top = float(fit.x[0]), float(fit.x[1])
    jacobian = np.asarray(fit.jac)
    information = jacobian.T @ jacobian
    sd = float(np.sqrt(np.linalg.pinv(information)[0, 0])) if information[0, 0] > 0 else float("inf")
    inside = place[0] < end < place[-1] - 0.5 * np.sqrt(2 * tip_radius * crest)
    return EndFit(end, sd, sign * top, bool(inside and 0 < sd < 0.2 * tip_radius and top > 0.4 * crest))


def end_trace(x: FloatArray, crest: float, sign: float, tip_radius: float, cap: float | None = None) -> FloatArray:
    """|Height| of the trace at distance x beyond the end (x < 0: on the crest), m."""
    if sign > 0:
        return cap_height(np.maximum(x, 0.0), crest, 0.5 * crest if cap is None else cap, tip_radius)
    inside = np.clip(-x, 0.0, np.sqrt(2.0 * tip_radius * crest))
    return np.asarray(inside**2 / (2.0 * tip_radius))


def _binned(s: FloatArray, height: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means of place and height in at most BINS bins of equal length, and the samples in each."""
    count = int(min(BINS, max(8, len(s) // 4)))
    cell = np.clip(((s - s[0]) / (s[-1] - s[0]) * count).astype(int), 0, count - 1)
    samples = np.bincount(cell, minlength=count).astype(float)
    used = samples > 0
    sums = [np.bincount(cell, weights=values, minlength=count)[used] for values in (s, height)]
    return sums[0] / samples[used], sums[1] / samples[used], samples[used]


def _covariance(place: FloatArray, samples: FloatArray, noise: Noise) -> FloatArray:
    gap = np.abs(place[:, None] - place[None, :])
    correlated = noise.correlated**2 * np.exp(-gap / max(noise.length, 1e-12))
    floor = 1e-12 * float(np.ptp(place)) ** 2
    return np.asarray(correlated + np.diag(noise.white**2 / samples + floor))
