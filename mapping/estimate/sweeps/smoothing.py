"""Curvature-limited smoothing: a trace cleared of what no ball can trace, at the scale that its noise demands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mapping import BoolArray, FloatArray, IntArray, Trace
from mapping.estimate.sweeps.smoothing_spline import position_sd, smoothing_length, smoothing_spline
from mapping.estimate.sweeps.tangents import chord_lengths, unit
from mapping.instrument import Noise, estimate_noise

# Samples are averaged over this share of the smoothing length: finer ones carry no more information.
BLOCK_SHARE = 1 / 8
MOST_SMOOTHING_ROUNDS = 10
# A smoothing spline needs five points.
FEWEST_SPLINE_POINTS = 5

# Gives directions (M, 3) away from the body at ball centres (M, 3)
Directions = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A smoothed trace.

    Args:
        trace: block means of the original, smoothed; M samples, about eight to a smoothing length.
        sample: (M,) index of the original sample in the middle of each block.
        curvature: (M,) curvature of the smoothed trace along its sweeps, 1/m, positive where it bulges out.
        scale: smoothing length h of each sweep's spline, m: wavelengths below 2 pi h are suppressed.
        sd: standard deviation of the noise that is left in a position, m.
        removed: number of original samples that were removed as impossible.
        noise: the noise that the scale was chosen for.
        outward: (M, 3) directions away from the body.
    """

    trace: Trace
    sample: IntArray
    curvature: FloatArray
    scale: float
    sd: float
    removed: int
    noise: Noise
    outward: FloatArray

    @cached_property
    def dented(self) -> BoolArray:
        """(M,) where the trace may hold a kink: within two smoothing lengths of dents beyond k_t = -1/r.

        A kink that is smoothed over the length h is indistinguishable from a dent of a few h.
        """
        deep = np.flatnonzero(self.curvature * self.trace.tip_radius < -1)
        reach = int(np.ceil(2 / BLOCK_SHARE)) if self.scale > 0 else 0
        near = np.zeros(len(self.trace), dtype=bool)
        for shift in range(-reach, reach + 1):
            beside = np.clip(deep + shift, 0, len(near) - 1)
            near[beside[self.trace.sweep[beside] == self.trace.sweep[deep]]] = True
        return near


def smooth(trace: Trace, noise: Noise | None = None, *, outward: ArrayLike | Directions | None = None) -> Smoothed:
    """Remove impossible points of a trace, smooth the rest by a cubic smoothing spline over time.

    A ball's trace bulges by no more than k_t = 1/r; the estimated surface dents by no more than k_e = -1/r, which
    is the same statement, for k_e = k_t / (1 - r k_t) passes from +inf to -inf there. Points that bulge more than
    the noise explains are removed before the spline is fitted again. The smoothing length is the shortest at which
    the noise leaves the curvature 1/r standing out by three standard deviations: ball operators, which
    take extremes, then find no noise to take.

    Args:
        noise: of the centres; None estimates it from the residual of a first smoothing.
        outward: (3,) or (N, 3) directions away from the body, or what gives them for centres: it is asked for block
            means only; None takes recorded normals, else +z.

    Returns:
        The smoothed trace; noise of level zero returns the trace itself.

    Reference: the paper, section 3.3; theory sections 3 and 6; Reinsch, Smoothing by spline functions, 1967.
    """
    away = _outward(trace, outward)
    noise = _residual_noise(trace, away) if noise is None else noise
    parts = [(own.start, _Sweep(part, _of_part(away, own), trace.tip_radius)) for own, part in _sweeps(trace)]
    spacing = float(np.median([part.spacing for _, part in parts])) if parts else 0.0
    if noise.sd == 0 or spacing == 0:
        alike = [part.fitted(0.0) for _, part in parts]
        curvature = np.concatenate([fit.curvature for fit in alike]) if parts else np.zeros(0)
        directions = np.concatenate([fit.outward for fit in alike]) if parts else np.zeros((0, 3))
        return Smoothed(trace, np.arange(len(trace)), curvature, 0.0, 0.0, 0, noise, directions)
    scale = smoothing_length(noise, spacing, trace.tip_radius)
    fits = [part.fitted(scale) for _, part in parts]
    return Smoothed(
        Trace.concatenate([fit.trace for fit in fits]),
        np.concatenate([start + fit.sample for (start, _), fit in zip(parts, fits, strict=True)]),
        np.concatenate([fit.curvature for fit in fits]),
        scale,
        position_sd(noise, spacing, scale),
        sum(fit.removed for fit in fits),
        noise,
        np.concatenate([fit.outward for fit in fits]),
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """One smoothed sweep: block means, the sample in the middle of each, curvature, samples removed, directions."""

    trace: Trace
    sample: IntArray
    curvature: FloatArray
    removed: int
    outward: FloatArray


class _Sweep:
    """One sweep ready to be fitted at any scale."""

    def __init__(self, trace: Trace, outward: FloatArray | Directions, tip_radius: float) -> None:
        self.trace, self.outward, self.tip_radius = trace, outward, tip_radius
        steady = len(trace) > 1 and bool((np.diff(trace.t) > 0).all())
        t = trace.t - trace.t[0] if steady else np.arange(len(trace), dtype=np.float64)
        # The commanded way: noise lengthens the path of single samples, so its length is taken from means.
        pieces = [chunk.mean(axis=0) for chunk in np.array_split(trace.centers, min(32, max(1, len(trace) // 8)))]
        length = float(chord_lengths(np.array(pieces))[-1]) * len(pieces) / max(len(pieces) - 1, 1)
        self.s = t / t[-1] * length if len(t) > 1 and length > 0 else t * 0.0
        self.spacing = length / (len(trace) - 1) if len(trace) > 1 else 0.0

    def fitted(self, scale: float) -> _Fit:
        """The sweep smoothed at one scale and cleared of impossible blocks."""
        blocks = self._blocks(scale)
        s, centers, weight = self._means(self.s, blocks), self._means(self.trace.centers, blocks), np.diff(blocks)
        given = self.outward
        outward = given(centers) if callable(given) else unit(self._means(given, blocks))
        kept = np.ones(len(s), dtype=bool)
        positions, curvature = _spline(s, centers, weight, outward, kept, scale, self.spacing)
        for _ in range(MOST_SMOOTHING_ROUNDS if scale > 0 else 0):
            worst = _impossible(np.where(kept, curvature, -np.inf), self.tip_radius)
            if not worst.any() or (kept & ~worst).sum() < FEWEST_SPLINE_POINTS:
                break
            kept &= ~worst
            positions, curvature = _spline(s, centers, weight, outward, kept, scale, self.spacing)
        middles = ((blocks[:-1] + blocks[1:]) // 2)[kept]
        away = outward[kept] if callable(given) else given[middles]
        return _Fit(self._trace(positions, blocks, kept), middles, curvature[kept], int(weight[~kept].sum()), away)

    def _trace(self, positions: FloatArray, blocks: IntArray, kept: BoolArray) -> Trace:
        def mean(values: FloatArray | None) -> FloatArray | None:
            return None if values is None else self._means(values, blocks)[kept]

        trace = self.trace
        normals = mean(trace.normals)
        return Trace(
            self._means(trace.t, blocks)[kept],
            positions[kept],
            np.full(int(kept.sum()), trace.sweep[0]),
            self.tip_radius,
            None if normals is None else unit(normals),
            mean(trace.contacts),
            mean(trace.force),
            trace.resolution,
        )

    def _blocks(self, scale: float) -> IntArray:
        """Borders of equal blocks, a small share of the smoothing length each."""
        size = max(1, int(BLOCK_SHARE * scale / self.spacing)) if self.spacing > 0 else 1
        size = max(1, min(size, len(self.trace) // 16))
        borders = np.arange(0, len(self.trace) + 1, size)
        borders[-1] = len(self.trace)
        return borders

    @staticmethod
    def _means(values: FloatArray, blocks: IntArray) -> FloatArray:
        sums = np.add.reduceat(values, blocks[:-1], axis=0)
        counts = np.diff(blocks).reshape(-1, *([1] * (values.ndim - 1)))
        return np.asarray(sums / counts)


def _impossible(curvature: FloatArray, tip_radius: float) -> BoolArray:
    """Local maxima of curvature beyond 1/r by more than its noise, which three times over is 1/r too."""
    beyond = curvature > 2 / tip_radius
    peak = (curvature >= np.r_[-np.inf, curvature[:-1]]) & (curvature >= np.r_[curvature[1:], -np.inf])
    return np.asarray(beyond & peak)


def _spline(
    s: FloatArray,
    centers: FloatArray,
    weight: IntArray,
    outward: FloatArray,
    kept: BoolArray,
    scale: float,
    spacing: float,
) -> tuple[FloatArray, FloatArray]:
    """Smoothing spline through the kept blocks: its values and its curvature towards `outward` at all blocks."""
    if kept.sum() < FEWEST_SPLINE_POINTS or s[-1] == s[0]:
        return centers, np.zeros(len(s))
    # In units of a block's length the banded system is well scaled at any size of tip.
    unit_length = (s[-1] - s[0]) / (len(s) - 1)
    origin = centers.mean(axis=0)
    lam = scale**4 / (spacing * unit_length**3) if spacing > 0 else 0.0
    x = (s - s[0]) / unit_length
    spline = smoothing_spline(x[kept], (centers[kept] - origin) / unit_length, weight[kept], lam)
    first, second = spline(x, 1), spline(x, 2) / unit_length
    speed = np.maximum((first**2).sum(axis=1), 1e-300)
    along = unit(first)
    normal = unit(outward - np.einsum("ij,ij->i", outward, along)[:, None] * along)
    return spline(x) * unit_length + origin, -np.einsum("ij,ij->i", second, normal) / speed


def _residual_noise(trace: Trace, outward: FloatArray | Directions) -> Noise:
    """Noise of the height residual about splines as stiff as a third of the tip's radius."""
    residuals, places, end = [], [], 0.0
    for own, part in _sweeps(trace):
        away = _of_part(outward, own)
        sweep = _Sweep(part, away, trace.tip_radius)
        fitted = sweep.fitted(trace.tip_radius / 3).trace
        if len(fitted) < 2:
            continue
        expected = np.column_stack([np.interp(part.t, fitted.t, fitted.centers[:, k]) for k in range(3)])
        up = unit(away(part.centers) if callable(away) else away)
        residuals.append(np.einsum("ij,ij->i", part.centers - expected, up))
        places.append(sweep.s + end)
        end = float(places[-1][-1]) + 100 * trace.tip_radius
    return estimate_noise(np.concatenate(residuals), np.concatenate(places))


def _sweeps(trace: Trace) -> list[tuple[slice, Trace]]:
    parts, start = [], 0
    for _, part in trace.sweeps():
        parts.append((slice(start, start + len(part)), part))
        start += len(part)
    return parts


def _of_part(outward: FloatArray | Directions, own: slice) -> FloatArray | Directions:
    return outward if callable(outward) else outward[own]


def _outward(trace: Trace, outward: ArrayLike | Directions | None) -> FloatArray | Directions:
    if callable(outward):
        return outward
    if outward is None:
        outward = (0.0, 0.0, 1.0) if trace.normals is None else trace.normals
    return np.array(np.broadcast_to(np.asarray(outward, dtype=np.float64), trace.centers.shape))
