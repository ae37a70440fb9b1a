"""The paper's four algorithms (figure 4) on a single sweep, each with the threshold of the surface it stands on.

| number | what it differentiates | convex | concave |
|---|---|---|---|
| 1 | the estimated surface from contact data | k > 1/r | k < -1/r |
| 2 | the contact normal along the path of the centre | k_t > 1/(2r) | k_t < -1/r |
| 3 | the traced surface | k_t > 1/(2r) | k_t < -1/r (a kink) |
| 4 | the surface estimated from the trace by balls | k > 1/r | k < -1/r |

On an estimated surface k never falls below -1/r (an unreachable hollow shows as a fillet of the tip's radius), which
is why 1 and 4 are blind to concave features; and on a trace k_t never exceeds 1/r, which is why the paper's
threshold 1/r finds nothing convex there (theory section 3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mapping import DetectionError, FloatArray, Trace
from mapping.estimate.sweeps import CurvatureFeature, curvature_along, features_beyond, half_width_for, joined
from mapping.instrument import Noise, robust_sd

# A curve is put on this many steps per fit: more only cost time.
STEPS_PER_FIT = 40
# Narrowest fit to estimated surfaces and normals, in tip radii: narrower ones see grids and facets.
NARROWEST_FIT = 0.02
# Share by which a concave feature of an estimated surface must exceed the fillets' own curvature.
FILLET = 0.05


@dataclass(frozen=True, eq=False)
class CurvatureProfile:
    """What an algorithm sees along a sweep.

    Args:
        s: (N,) places along the sweep's chord, m.
        curvature: (N,) 1/m, of the surface that the algorithm stands on.
        convex, concave: thresholds of that surface, 1/m; concave < 0.
        half_width: of the local fits, m.
    """

    s: FloatArray
    curvature: FloatArray
    convex: float
    concave: float
    half_width: float

    @property
    def features(self) -> tuple[CurvatureFeature, ...]:
        """Stretches beyond a threshold, less what the noise made of them, and less those of the end windows alone."""
        found = joined(features_beyond(self.s, self.curvature, self.convex, self.concave), self.half_width)
        low, high = self.s.min() + self.half_width, self.s.max() - self.half_width
        return tuple(f for f in found if max(f.start, f.stop) > low and min(f.start, f.stop) < high)


def curvature_features(trace: Trace, algorithm: int = 3, noise: Noise | None = None) -> tuple[CurvatureFeature, ...]:
    """Curvature features along one sweep, by arclength of the centre's path projected on the sweep's chord.

    Args:
        trace: a single sweep; algorithms 1 and 2 need its contact normals.
        algorithm: number in figure 4 of the paper.
        noise: of the centres, or None: white, its level estimated from differences of neighbouring samples. Contact
            points (algorithm 1) share its correlated part alone, normals (algorithm 2) none of it.

    Raises:
        DetectionError: an unknown algorithm, fewer than 16 samples, or no contact data where it is needed.

    Reference: paper section 3.1 and figure 4.
    """
    return curvature_profile(trace, algorithm, noise).features


def curvature_profile(trace: Trace, algorithm: int = 3, noise: Noise | None = None) -> CurvatureProfile:
    """The curvature that an algorithm tests, and its thresholds; arguments and errors as `curvature_features`."""
    if algorithm not in ALGORITHMS:
        raise DetectionError(f"unknown algorithm {algorithm!r}; the paper has 1, 2, 3 and 4")
    if len(trace) < 16:
        raise DetectionError(f"curvature along a sweep needs at least 16 samples; found {len(trace)}")
    if algorithm in (1, 2) and trace.normals is None:
        raise DetectionError(f"algorithm {algorithm} needs contact normals; the trace has positions alone: use 3 or 4")
    return ALGORITHMS[algorithm](trace, noise)


def along_chord(trace: Trace, points: FloatArray) -> FloatArray:
    """(N,) places of points (N, 3) along the sweep, in the coordinate of `curvature_features`, m."""
    return _planar(trace, points)[0]


def _estimated_from_contacts(trace: Trace, noise: Noise | None) -> CurvatureProfile:
    normals = _given(trace.normals)
    contacts = trace.centers - trace.tip_radius * normals if trace.contacts is None else trace.contacts
    x, z = _planar(trace, contacts)
    level = _level(z) if noise is None else replace(noise, white=_level(z).white)
    grid, smooth, half_width = _smoothed(x, z, level, trace.tip_radius, 1 / trace.tip_radius)
    # contacts leap over what the tip cannot reach: there the estimate is the tip's own arc
    closed = _eroded(-_eroded(-smooth, grid, trace.tip_radius), grid, trace.tip_radius)
    return _on_estimate(grid, closed, half_width, trace.tip_radius)


def _normal_derivative(trace: Trace, _: Noise | None) -> CurvatureProfile:
    along, outward = _frame(trace)
    x = _planar(trace, trace.centers)[0]
    normals = _given(trace.normals)
    angle = np.unwrap(np.arctan2(normals @ along, normals @ outward))
    level = robust_sd(np.diff(angle)) / np.sqrt(2)
    spacing = float(np.ptp(x)) / (len(x) - 1)
    # slope of a line over 2 w: sd^2 = 3 sigma^2 Delta / (2 w^3) (theory equation 6.5)
    threshold = 1 / (2 * trace.tip_radius)
    half_width = max(
        float((13.5 * level**2 * spacing / threshold**2) ** (1 / 3)), 4 * spacing, NARROWEST_FIT * trace.tip_radius
    )
    grid, angle = _even(x, angle, half_width)
    from scipy.signal import savgol_filter

    size = min(2 * max(2, round(half_width / (grid[1] - grid[0]))) + 1, len(grid) - (len(grid) + 1) % 2)
    slope = savgol_filter(angle, size, 1, deriv=1, delta=grid[1] - grid[0], mode="interp")
    # the centre rises by tan(angle): its path is longer than its chord
    return CurvatureProfile(grid, slope * np.cos(angle), threshold, -1 / trace.tip_radius, half_width)


def _traced(trace: Trace, noise: Noise | None) -> CurvatureProfile:
    x, z = _planar(trace, trace.centers)
    level = noise or _level(z)
    wide = _curve(x, z, level, trace.tip_radius, 1 / (2 * trace.tip_radius))
    # the concave threshold is twice the convex one and bears narrower fits, which see kinks more sharply
    narrow = _curve(x, z, level, trace.tip_radius, 1 / trace.tip_radius)
    kinks = np.interp(wide.s, narrow.s, narrow.curvature)
    return replace(wide, curvature=np.where(kinks < wide.concave, np.minimum(kinks, wide.curvature), wide.curvature))


def _estimated_from_trace(trace: Trace, noise: Noise | None) -> CurvatureProfile:
    x, z = _planar(trace, trace.centers)
    # balls on raw noise are biased by its extremes (theory section 6): smooth first
    grid, smooth, half_width = _smoothed(x, z, noise or _level(z), trace.tip_radius, 1 / (2 * trace.tip_radius))
    return _on_estimate(grid, _eroded(smooth, grid, trace.tip_radius), half_width, trace.tip_radius)


ALGORITHMS: dict[int, Callable[[Trace, Noise | None], CurvatureProfile]] = {
    1: _estimated_from_contacts,
    2: _normal_derivative,
    3: _traced,
    4: _estimated_from_trace,
}


def _curve(x: FloatArray, z: FloatArray, noise: Noise, tip: float, convex: float) -> CurvatureProfile:
    """Curvature of a curve z(x) by quadratics as wide as its noise demands."""
    half_width = half_width_for(noise, float(np.ptp(x)) / (len(x) - 1), convex)
    grid, even = _even(x, z, half_width)
    return CurvatureProfile(grid, curvature_along(grid, even, half_width), convex, -1 / tip, half_width)


def _smoothed(
    x: FloatArray, z: FloatArray, noise: Noise, tip: float, threshold: float
) -> tuple[FloatArray, FloatArray, float]:
    """An even grid, z smoothed on it by quadratics, and their half-width."""
    from scipy.signal import savgol_filter

    spacing = float(np.ptp(x)) / (len(x) - 1)
    half_width = max(half_width_for(noise, spacing, threshold), NARROWEST_FIT * tip)
    grid, even = _even(x, z, half_width)
    size = min(2 * max(2, round(half_width / (grid[1] - grid[0]))) + 1, len(grid) - (len(grid) + 1) % 2)
    return grid, np.asarray(savgol_filter(even, size, 2, mode="interp")), half_width


def _eroded(z: FloatArray, grid: FloatArray, tip: float) -> FloatArray:
    """Lower envelope of balls centred on the curve z(x)."""
    step = grid[1] - grid[0]
    reach = min(int(tip / step), len(z) - 1)
    lowest = z - tip
    for k in range(1, reach + 1):
        ball = np.sqrt(max(tip**2 - (k * step) ** 2, 0.0))
        lowest[:-k] = np.minimum(lowest[:-k], z[k:] - ball)
        lowest[k:] = np.minimum(lowest[k:], z[:-k] - ball)
    return np.asarray(lowest)


def _on_estimate(grid: FloatArray, z: FloatArray, half_width: float, tip: float) -> CurvatureProfile:
    """Curvature of an estimated surface, whose fillets of exactly -1/r are no features."""
    return CurvatureProfile(grid, curvature_along(grid, z, half_width), 1 / tip, -(1 + FILLET) / tip, half_width)


def _level(z: FloatArray) -> Noise:
    """Noise of single samples: second differences know no slope, and features are rare."""
    return Noise(robust_sd(np.diff(z, 2)) / float(np.sqrt(6)))


def _frame(trace: Trace) -> tuple[FloatArray, FloatArray]:
    """Unit directions along the sweep and outward, perpendicular to it."""
    along = trace.centers[-1] - trace.centers[0]
    along = along / np.linalg.norm(along)
    if trace.normals is not None:
        hint = trace.normals.mean(axis=0)
    else:
        offset = trace.centers - trace.centers.mean(axis=0)
        across = offset - np.outer(offset @ along, along)
        hint = np.linalg.svd(across, full_matrices=False)[2][0]
        hint = hint * (1.0 if hint[np.abs(hint).argmax()] > 0 else -1.0)
        if abs(along[2]) < 0.9:
            hint = np.array([0.0, 0.0, 1.0])
    outward = hint - (hint @ along) * along
    return np.asarray(along), np.asarray(outward / np.linalg.norm(outward))


def _planar(trace: Trace, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coordinates along the sweep's chord and outward, in the order of the sweep."""
    along, outward = _frame(trace)
    offset = points - trace.centers[0]
    return np.asarray(offset @ along), np.asarray(offset @ outward)


def _even(x: FloatArray, z: FloatArray, half_width: float) -> tuple[FloatArray, FloatArray]:
    """Means of z over equal steps of x, STEPS_PER_FIT of them in a half-width (never finer than the samples)."""
    spacing = float(np.ptp(x)) / (len(x) - 1)
    step = max(half_width / STEPS_PER_FIT, spacing)
    if step < 1.5 * spacing and (np.diff(x) > 0).all():
        grid = np.linspace(x[0], x[-1], len(x))
        return grid, np.interp(grid, x, z)
    bins = np.floor((x - x.min()) / step).astype(np.int64)
    counts = np.bincount(bins)
    filled = counts > 0
    centre = x.min() + (np.arange(len(counts)) + 0.5) * step
    mean = np.interp(centre, centre[filled], np.bincount(bins, weights=z)[filled] / counts[filled])
    # beyond the path's ends lie only the few samples that noise threw there
    well = np.flatnonzero(counts >= 0.5 * np.median(counts[filled]))
    return centre[well[0] : well[-1] + 1], mean[well[0] : well[-1] + 1]


def _given(array: FloatArray | None) -> FloatArray:
    assert array is not None
    return array
