"""Unshared heights: what of a sweep its neighbours do not foretell; of that alone is noise made.

Noise is drawn anew on every sweep, the surface is not. On sweeps that lie mostly on one detail no quiet path tells the
noise, and the detail itself passes for noise that is correlated over its own width, under which nothing is found. Where
sweeps foretell what lies between them better than any law of noise does, the law is that of the differences.

A rough surface repeats, too, as far as its sweeps are close, and what stands out of it is told by a law of the
roughness: by one of many bumps. One detail is no law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapping import FloatArray
from mapping.instrument.block_likelihood import Blocks, most_likely
from mapping.instrument.noise import Noise
from mapping.instrument.robust import robust_sd

# Sweeps, at least: one between two others tells, and a second one that it was not chance
ROWS_THAT_SHARE = 5
# Bins that a row has at least: the start of a law of two numbers is told by seven differences to 1 / sqrt(14), 27 %
ROW_BINS = 8
# Bins that the two laws are held against each other with: a difference in the level of a tenth is one of ten in the
# logarithm of the likelihood
MOST_COMPARED = 2000
# Share of the scatter that a fit's white noise begins with at least: its logarithm is searched, and must be a number
LEAST_WHITE = 1e-6
# Share of a sweep that its neighbours must lie beside: what is filled up elsewhere would else be most of it
MOSTLY_BESIDE = 0.5
# Independent values of what is shared from which on it is a surface's roughness: by so many a law's level is known to
# 1 / sqrt(2 * 20), 16 %. Of simulated shapes of 6 to 96 values that all rows share 0.6 of them are counted, for each
# has its own chance correlations; a crest as wide as the rows, a little aslant, counts as 2 to 6
ROUGHNESS_VALUES = 20.0


@dataclass(frozen=True, eq=False)
class Row:
    """What one sweep read, in bins of one length.

    Args:
        places: (n, 3) m.
        height: (n,) m.
        step: from bin to bin, m.
        samples: in a bin.
    """

    places: FloatArray
    height: FloatArray
    step: float
    samples: float


def unshared(rows: Sequence[Row]) -> list[FloatArray] | None:
    """Heights (n,) of each row less what its neighbours foretell of it, as large as its own noise, m.

    None where neighbours foretell less than a law of noise does, and where what they share is a roughness.

    Args:
        rows: one of each sweep, in bins of one length.
    """
    if len(rows) < ROWS_THAT_SHARE or min(len(row.height) for row in rows) < ROW_BINS:
        return None
    beside = _Beside(rows)
    if beside.one_on_another:
        return None
    rest = [beside.rest(k) for k in range(len(rows))]
    if any(np.isfinite(each).mean() < MOSTLY_BESIDE for each in rest):
        return None
    if not beside.foretell() or beside.shared_values() >= ROUGHNESS_VALUES:
        return None
    return [_filled(each) for each in rest]


class _Beside:
    """Rows in the order in which they lie side by side.

    Args:
        rows: (K) of them.
    """

    def __init__(self, rows: Sequence[Row]) -> None:
        self.rows = rows
        middles = np.array([row.places.mean(axis=0) for row in rows])
        way = np.linalg.svd(middles - middles.mean(axis=0), full_matrices=False)[2][0]
        # (K,) places from one side to the other, m, and the rows' numbers in that order
        self.across = middles @ way
        self.order = np.argsort(self.across, kind="stable")
        self._trees: dict[int, Any] = {}

    @property
    def one_on_another(self) -> bool:
        """True if two rows lie in one place: no line through both foretells a third."""
        return bool(np.diff(self.across[self.order]).min() <= 0.0)

    def foretell(self) -> bool:
        """True if the sweeps on either side tell every other one better than the likeliest noise of its own does."""
        inner = self.order[1:-1:2]
        rest = [self.rows[k].height - self._told(k)[0] for k in inner.tolist()]
        own = [np.where(np.isfinite(r), self.rows[k].height, np.nan) for k, r in zip(inner, rest, strict=True)]
        count = max(2, MOST_COMPARED // len(inner))
        return self._misfit(rest, count) < self._misfit(own, count)

    def _misfit(self, heights: Sequence[FloatArray], count: int) -> float:
        """Twice the negative log-likelihood of so many bins of each row under the likeliest noise of one process;
        minus infinity of heights that are all one."""
        row = self.rows[0]
        cut = [h[(len(h) - count) // 2 :][:count] if len(h) > count else h for h in heights]
        values = np.concatenate(cut)
        steps = np.concatenate([np.where(np.arange(len(h)) > 0, 1.0, -1.0) for h in cut]) * row.step
        jumps = np.concatenate([np.diff(h) for h in cut])
        scatter = float(np.nanstd(values))
        if scatter == 0.0:
            return -np.inf
        # where the fit begins: without noise most bins are as high as the next one
        white = max(robust_sd(jumps[np.isfinite(jumps)]), LEAST_WHITE * scatter) * np.sqrt(0.5 * row.samples)
        start = Noise(white, scatter, 0.25 * count * row.step)
        return most_likely([Blocks(values, steps, row.samples)], start, None)[1]

    def rest(self, k: int) -> FloatArray:
        """(n,) heights of a row less what its neighbours foretell, as large as its own noise, m; NaN where these
        do not lie beside it."""
        told, variance = self._told(k)
        return np.asarray((self.rows[k].height - told) / np.sqrt(variance))

    def _told(self, k: int) -> tuple[FloatArray, FloatArray]:
        """(n,) heights that its neighbours foretell of a row, m, NaN where these do not lie beside it, and variances of
        the noise in what that leaves of it, in that of a bin."""
        told, variance = np.zeros(len(self.rows[k].height)), np.ones(len(self.rows[k].height))
        for j, weight in self._neighbours(k):
            height, shares = self._beside(k, j)
            told += weight * height
            variance += weight**2 * shares
        return told, variance

    def _neighbours(self, k: int) -> tuple[tuple[int, float], ...]:
        """The two nearest rows on either side, or on the one side of the last, and their weights: a straight line
        through both."""
        at = int(np.flatnonzero(self.order == k)[0])
        last = len(self.order) - 1
        one, other = (at - 1, at + 1) if 0 < at < last else ((1, 2) if at == 0 else (last - 1, last - 2))
        i, j = int(self.order[one]), int(self.order[other])
        share = float((self.across[k] - self.across[i]) / (self.across[j] - self.across[i]))
        return (i, 1.0 - share), (j, share)

    def _beside(self, k: int, j: int) -> tuple[FloatArray, FloatArray]:
        """(n,) heights of another row at the places nearest to a row's bins, between its bins, NaN beyond, and the
        variances of white noise in them, in that of a bin."""
        from scipy.spatial import cKDTree

        if j not in self._trees:
            self._trees[j] = cKDTree(self.rows[j].places)
        centers, height = self.rows[j].places, self.rows[j].height
        near = np.clip(np.asarray(self._trees[j].query(self.rows[k].places)[1]), 1, len(height) - 2)
        way = centers[near + 1] - centers[near - 1]
        ahead = 2.0 * np.einsum("ij,ij->i", self.rows[k].places - centers[near], way)
        place = near + ahead / np.einsum("ij,ij->i", way, way)
        share = place - np.floor(place)
        at = np.interp(place, np.arange(len(height)), height, left=np.nan, right=np.nan)
        return np.asarray(at), np.asarray(share**2 + (1.0 - share) ** 2)

    def shared_values(self) -> float:
        """How many independent values of what the sweeps share were felt.

        Of its shapes from sweep to sweep and of its length along them: (sum of the eigenvalues)^2 over the sum of their
        squares is the number of equal ones.
        """
        middle = int(self.order[len(self.order) // 2])
        rows = np.array([self._beside(middle, j)[0] for j in self.order.tolist()])
        rows = np.where(np.isfinite(rows), rows, 0.0)
        return _effective(rows @ rows.T) * _effective(_autocovariance(rows))


def _autocovariance(rows: FloatArray) -> FloatArray:
    """(n, n) covariance along rows (K, n) of a process that is the same everywhere, by its mean over all places."""
    count = rows.shape[1]
    power = np.abs(np.fft.rfft(rows, 2 * count, axis=1)) ** 2
    lags = np.fft.irfft(power.mean(axis=0))[:count] / count
    return np.asarray(lags[np.abs(np.subtract.outer(np.arange(count), np.arange(count)))])


def _effective(covariance: FloatArray) -> float:
    """Number of equal eigenvalues that have the same sum and the same sum of squares."""
    return float(np.trace(covariance) ** 2 / np.sum(covariance**2))


def _filled(height: FloatArray) -> FloatArray:
    """Heights (n,) without NaN: at the ends what stands next to them, mirrored, and linear between."""
    known = np.flatnonzero(np.isfinite(height))
    inner = np.interp(np.arange(known[0], known[-1] + 1), known, height[known])
    return np.pad(inner, (int(known[0]), len(height) - 1 - int(known[-1])), mode="reflect")
