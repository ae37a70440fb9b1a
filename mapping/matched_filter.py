"""Matched filters: the best linear detectors of a cap of any size at any place of a noisy profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapping.noise import Noise

FloatArray = NDArray[np.float64]

# Ratio of neighbouring half-widths: a cap between two templates loses less than 0.6 % of its signal-to-noise.
LADDER = 1.2
# Bins per half-width: averaging over a bin loses less than 1 %.
BINS_PER_HALF_WIDTH = 12


@dataclass(frozen=True, eq=False)
class MatchedFilter:
    """Best linear unbiased estimate of a cap's height from profile bins around a place.

    Args:
        half_width: of the cap 1 - (x/w)^2, m.
        coarse: number of profile bins averaged into one bin of the filter.
        weights: (2 M + 1,) of the filter's bins; applied to heights they give the cap's height.
        edge: (M, 2 M + 1) weights where only i bins exist before the centre; rows i = 0 to M - 1.
        sd: standard deviation of the estimate, m.
        edge_sd: (M,) the same near the ends.
    """

    half_width: float
    coarse: int
    weights: FloatArray
    edge: FloatArray
    sd: float
    edge_sd: FloatArray

    def heights(self, profile: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Estimated height of a cap centred at each coarse bin of a profile (n,), and its standard deviation."""
        from scipy.signal import oaconvolve

        whole = len(profile) // self.coarse * self.coarse
        bins = profile[:whole].reshape(-1, self.coarse).mean(axis=1)
        reach = len(self.weights) // 2
        padded = np.concatenate([np.zeros(reach), bins, np.zeros(reach)])
        heights = np.asarray(oaconvolve(padded, self.weights[::-1], mode="valid"))
        sd = np.full(len(bins), self.sd)
        count = min(len(self.edge), len(bins))
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
        heights[:count] = np.einsum("ij,ij->i", windows[:count], self.edge[:count])
        heights[len(bins) - count :] = np.einsum("ij,ij->i", windows[::-1][:count, ::-1], self.edge[:count])[::-1]
        sd[:count] = self.edge_sd[:count]
        sd[len(bins) - count :] = np.maximum(sd[len(bins) - count :], self.edge_sd[:count][::-1])
        return heights, sd


@dataclass(frozen=True, eq=False)
class Bank:
    """Matched filters of growing half-width.

    Args:
        filters: the filters.
        spacing: width of a profile bin, m.
        samples: samples in a profile bin.
        noise: of single samples.
        drift: number of polynomial terms of the base that each filter ignores (0: the base is known).
    """

    filters: tuple[MatchedFilter, ...]
    spacing: float
    samples: float
    noise: Noise
    drift: int = 0

    def detection_limit(self, threshold: float, tip_radius: float) -> float:
        """Smallest height of a sharp crest under this tip that is detected with 95 % probability, m.

        A crest of height D disturbs sqrt(2 r D) on either side; 1.645 is the 95 % quantile of the noise.
        """
        widths = np.array([f.half_width for f in self.filters])
        needed = np.array([f.sd for f in self.filters]) * (threshold + 1.6448536)
        available = widths**2 / (2 * tip_radius)
        enough = available >= needed
        if not enough.any():
            return float(needed[-1])
        first = int(enough.argmax())
        if first == 0:
            return float(needed[0])
        excess = np.log(available / needed)[first - 1 : first + 1]
        return float(np.exp(np.interp(0.0, excess, np.log(available)[first - 1 : first + 1])))


def build_bank(noise: Noise, spacing: float, samples: float, smallest: float, largest: float, drift: int = 0) -> Bank:
    """A bank of filters from the smallest to the largest half-width, m.

    Args:
        noise: of single samples.
        spacing: width of a profile bin, m.
        samples: samples in a profile bin.
        drift: 0 if the base is known; 2 if its offset and slope near a feature are not, 3 with its curvature.
    """
    count = max(1, int(np.ceil(np.log(max(largest / smallest, 1.0)) / np.log(LADDER))) + 1)
    widths = np.geomspace(smallest, max(largest, smallest), count) if count > 1 else np.array([smallest])
    return Bank(
        tuple(_build_filter(float(w), noise, spacing, samples, drift) for w in widths), spacing, samples, noise, drift
    )


def smallest_half_width(noise: Noise, spacing: float, samples: float, tip_radius: float, threshold: float) -> float:
    """Half-width of the smallest sharp crest that stands out of the noise, m; never under 1.5 bins.

    A crest of half-width w is w^2 / (2 r) high; its estimate has the sd of the matched filter.
    """
    widths = np.geomspace(1.5 * spacing, 4 * tip_radius + 3 * spacing, 40)
    # information on a cap under white noise: 16 w / (15 sigma^2 Delta); under an OU process of correlation length L:
    # the integral of (T'^2 L + T^2 / L) / (2 sigma^2) over the cap T
    white = noise.white * np.sqrt(15 * spacing / (16 * widths * samples))
    length = max(noise.length, np.finfo(float).tiny)
    correlated = noise.correlated * np.sqrt(2 / (8 * length / (3 * widths) + 16 * widths / (15 * length)))
    visible = widths**2 / (2 * tip_radius) > threshold * np.hypot(white, correlated)
    return float(widths[visible.argmax()] if visible.any() else widths[-1])


def cap_bins(
    positions: FloatArray, half_width: float | FloatArray, spacing: float, flat: float | FloatArray = 0.0
) -> FloatArray:
    """Means over bins of a cap of unit height with a flat top of the given half-length and parabolic flanks."""

    def integral(x: FloatArray) -> FloatArray:
        edge = half_width - flat
        u = np.clip((np.abs(x) - flat) / edge, 0.0, 1.0)
        return np.asarray(np.sign(x) * (np.minimum(np.abs(x), flat) + edge * (u - u**3 / 3)))

    return (integral(positions + spacing / 2) - integral(positions - spacing / 2)) / spacing


def toeplitz(first: FloatArray) -> FloatArray:
    """(n, n) symmetric matrix of a stationary covariance from its first row."""
    index = np.arange(len(first))
    return np.asarray(first[np.abs(np.subtract.outer(index, index))])


def filter_reach(half_width: float, noise: Noise, step: float, drift: int) -> int:
    """Bins that a filter needs on either side: the cap, a stretch to know the drift by, and what noise it shares."""
    reach = int(np.ceil((3.5 if drift else 1.0) * half_width / step))
    if noise.correlated > 0:
        reach += int(min(np.ceil(2 * noise.length / step) + 1, 1.5 * half_width / step + 1))
    return reach


def _build_filter(half_width: float, noise: Noise, spacing: float, samples: float, drift: int) -> MatchedFilter:
    coarse = max(1, int(half_width / (BINS_PER_HALF_WIDTH * spacing)))
    step = coarse * spacing
    reach = filter_reach(half_width, noise, step, drift)
    x = np.arange(-reach, reach + 1, dtype=np.float64) * step
    template = cap_bins(x, half_width, step)
    covariance = toeplitz(noise.block_covariances(2 * reach + 1, step, samples * coarse))
    nuisance = (x[:, None] / (reach * step)) ** np.arange(drift, dtype=np.float64)
    weights, sd = best_linear(covariance, template, nuisance)
    edge, edge_sd = np.zeros((reach, 2 * reach + 1)), np.full(reach, np.inf)
    for i in range(reach):
        cut = slice(reach - i, None)
        edge[i, cut], edge_sd[i] = best_linear(covariance[cut, cut], template[cut], nuisance[cut])
    return MatchedFilter(half_width, coarse, weights, edge, sd, edge_sd)


def best_linear(covariance: FloatArray, template: FloatArray, nuisance: FloatArray) -> tuple[FloatArray, float]:
    """Weights of the best linear unbiased estimate of the template's amplitude, and its standard deviation.

    The covariance is symmetric and Toeplitz: Levinson's recursion takes O(n^2) steps and starts no threads.
    """
    from scipy.linalg import solve_toeplitz

    columns = np.column_stack([template, nuisance])
    solved = solve_toeplitz(covariance[0], columns, check_finite=False)
    if nuisance.shape[1] == 0:
        information = float(template @ solved[:, 0])
        return solved[:, 0] / information, 1 / float(np.sqrt(information))
    inverse = np.linalg.pinv(columns.T @ solved, hermitian=True)
    return solved @ inverse[:, 0], float(np.sqrt(max(inverse[0, 0], 0.0)))
