"""Curvature along one sweep by local quadratics as wide as the noise demands, and where it passes a threshold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray
from mapping.instrument import Noise

# Standard deviations of the curvature's noise that a threshold must be apart from zero.
THRESHOLD_SDS = 3.0
# Bins of a fit for which the effect of correlated noise is summed.
QUADRATIC_FIT_BINS = 120


@dataclass(frozen=True)
class CurvatureFeature:
    """A stretch of a sweep where the curvature is beyond a threshold (paper, definition 1).

    Args:
        sign: +1 convex, -1 concave.
        start, stop: arclengths of the crossings of the threshold, m.
        place: arclength of the extreme, m.
        curvature: at the extreme, 1/m.
    """

    sign: int
    start: float
    stop: float
    place: float
    curvature: float


def half_width_for(noise: Noise, spacing: float, threshold: float) -> float:
    """Half-width of a quadratic fit whose curvature has a third of the threshold as standard deviation, m.

    w = (45 sigma^2 Delta z^2 / (2 T^2))^(1/5) in white noise, theory section 6; never under four spacings.

    Args:
        noise: of the samples.
        spacing: between samples, m.
        threshold: of the curvature, 1/m.
    """
    from scipy.optimize import brentq

    white = float((22.5 * noise.white**2 * spacing * THRESHOLD_SDS**2 / threshold**2) ** 0.2)
    if not noise.terms:
        return max(white, 4 * spacing)
    # over many correlation lengths the process is white noise of this density; over few it is less than that
    density = float(noise.density(np.zeros(1), spacing)[0])
    widest = float((22.5 * density * THRESHOLD_SDS**2 / threshold**2) ** 0.2)

    def excess(log_width: float) -> float:
        return float(np.log(THRESHOLD_SDS * curvature_sd(noise, spacing, np.exp(log_width)) / threshold))

    low, high = np.log(4 * spacing), np.log(max(1.1 * widest, 8 * spacing))
    if excess(low) <= 0:
        return 4 * spacing
    return float(np.exp(brentq(excess, low, high, xtol=1e-4)))


def curvature_sd(noise: Noise, spacing: float, half_width: float) -> float:
    """Standard deviation of the second derivative of a least-squares quadratic over +-half_width, 1/m."""
    bin_width = 2 * half_width / QUADRATIC_FIT_BINS
    x = (np.arange(QUADRATIC_FIT_BINS) + 0.5) * bin_width - half_width
    weights = 3.75 / half_width**5 * (3 * x**2 - half_width**2) * bin_width
    covariance = noise.block_covariances(QUADRATIC_FIT_BINS, bin_width, bin_width / spacing)
    # a symmetric Toeplitz form is the weights' autocorrelation against the covariance
    products = np.correlate(weights, weights, "full")[QUADRATIC_FIT_BINS - 1 :]
    return float(np.sqrt(covariance[0] * products[0] + 2 * covariance[1:] @ products[1:]))


def curvature_along(x: FloatArray, z: FloatArray, half_width: float) -> FloatArray:
    """(N,) curvature, 1/m, positive where z bulges up, of a curve z(x) sampled at equal steps of x.

    Least-squares quadratics over +-half_width (Savitzky-Golay), with windows of the same size shifted inward at
    the ends.
    """
    from scipy.signal import savgol_filter

    spacing = float(x[1] - x[0])
    size = min(2 * max(2, round(half_width / spacing)) + 1, len(x) - (len(x) + 1) % 2)
    slope = savgol_filter(z, size, 2, deriv=1, delta=spacing, mode="interp")
    bend = savgol_filter(z, size, 2, deriv=2, delta=spacing, mode="interp")
    return np.asarray(-bend / (1 + slope**2) ** 1.5)


def features_beyond(
    s: FloatArray, curvature: FloatArray, convex: float, concave: float
) -> tuple[CurvatureFeature, ...]:
    """Stretches where curvature > convex (> 0) or curvature < concave (< 0), with interpolated boundaries."""
    found = []
    for sign, threshold in ((1, convex), (-1, concave)):
        beyond = sign * curvature > abs(threshold)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], beyond, [False]]).astype(np.int8)))
        for first, last in zip(edges[::2], edges[1::2] - 1, strict=True):
            peak = first + int((sign * curvature[first : last + 1]).argmax())
            start = _passing(s, curvature, first - 1, sign * abs(threshold)) if first > 0 else float(s[0])
            stop = _passing(s, curvature, last, sign * abs(threshold)) if last + 1 < len(s) else float(s[-1])
            found.append(CurvatureFeature(sign, start, stop, float(s[peak]), float(curvature[peak])))
    return tuple(sorted(found, key=lambda f: f.start))


def joined(features: tuple[CurvatureFeature, ...], half_width: float) -> tuple[CurvatureFeature, ...]:
    """Features less what the noise made of them: a feature that dips below its threshold for less than the width
    of a fit is one, and one shorter than a quarter of it is none."""
    whole: list[CurvatureFeature] = []
    for new in features:
        last = whole[-1] if whole else None
        if last is not None and last.sign == new.sign and new.start - last.stop < 2 * half_width:
            peak = max((last, new), key=lambda f: abs(f.curvature))
            whole[-1] = CurvatureFeature(last.sign, last.start, new.stop, peak.place, peak.curvature)
        elif new.stop - new.start > 0.5 * half_width:
            whole.append(new)
    return tuple(whole)


def _passing(s: FloatArray, curvature: FloatArray, index: int, level: float) -> float:
    """Where the curvature passes a level between two samples (linear)."""
    a, b = curvature[index], curvature[index + 1]
    return float(s[index] + (level - a) / (b - a) * (s[index + 1] - s[index]))
