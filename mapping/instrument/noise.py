"""Noise: the level and the correlation of the finger's error along its path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mapping import FloatArray, NoiseError
from mapping.instrument.levels import Levels
from mapping.instrument.robust import robust_sd
from mapping.instrument.states import Filter, mean_steps, point_steps
from mapping.instrument.term import Term

# Rounding of contact geometry, in tip radii, and of numbers, in the greatest of them: no noise is taken to be smaller
CONTACT_ROUNDING = 1e-8
LEAST_DIGITS = 1e-12

# A correlated part must lower chi-square by this much, or the noise counts as white.
LEAST_CHI_SQUARE_GAIN = 6.0

# Below so many correlation lengths the closed forms cancel; their series in x, with (k + 2)! below, do not.
SERIES_LIMIT = 0.5
SERIES_POWERS = np.arange(20)
SIGNS = (-1.0) ** SERIES_POWERS
FACTORIALS = np.cumprod(np.arange(1.0, 22.0))[SERIES_POWERS + 1]


@dataclass(frozen=True)
class Noise:
    """White noise plus Ornstein-Uhlenbeck processes and oscillators along the arclength.

    The covariance of two samples is white^2 delta_ij + correlated^2 exp(-|s_i - s_j| / length), and what further terms
    add to it.

    Args:
        white: standard deviation of the independent part, m.
        correlated: standard deviation of the correlated part, m.
        length: correlation length, m; matters only where `correlated` is positive.
        further: correlated terms beyond that one, where one does not explain what is measured.
        levels: by how much the noise of a recording is louder and quieter than this law along its sweeps; None: it
            is of one level. Two noises are equal if their laws are.

    Raises:
        NoiseError: a negative or non-finite value, or correlated noise without a positive length.

    Reference: theory section 6, equation 6.16.
    """

    white: float
    correlated: float = 0.0
    length: float = 1e-3
    further: tuple[Term, ...] = ()
    levels: Levels | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        values = (self.white, self.correlated, self.length)
        if not all(np.isfinite(value) and value >= 0 for value in values):
            raise NoiseError(f"noise needs finite white, correlated and length >= 0; found {values}")
        for name, value in zip(("white", "correlated", "length"), values, strict=True):
            object.__setattr__(self, name, float(value))
        if self.correlated > 0 and self.length == 0:
            raise NoiseError("correlated noise needs a positive correlation length; found 0")

    @classmethod
    def of_terms(cls, white: float, terms: Sequence[Term], length: float = 1e-3) -> Noise:
        """White noise and terms; `length` stands where none of them is an Ornstein-Uhlenbeck process."""
        plain = [t for t in terms if not t.turns]
        first = max(plain, key=lambda t: t.sd, default=None)
        if first is None:
            return cls(white, 0.0, length, tuple(terms))
        return cls(white, first.sd, first.length, tuple(t for t in terms if t is not first))

    @classmethod
    def read(cls, record: Mapping[str, Any]) -> Noise:
        """The noise of a `record`.

        Raises:
            KeyError, TypeError, NoiseError: it is none.
        """
        further = tuple(Term(**term) for term in record.get("further", ()))
        return cls(record["white"], record["correlated"], record["length"], further)

    @property
    def terms(self) -> tuple[Term, ...]:
        """All correlated parts."""
        own = (Term(self.correlated, self.length),) if self.correlated > 0 else ()
        return own + self.further

    @property
    def record(self) -> dict[str, Any]:
        """Its numbers, for JSON; no further terms are no entry, and a wavelength that is infinite is none."""
        numbers: dict[str, Any] = {"white": self.white, "correlated": self.correlated, "length": self.length}
        if self.further:
            numbers["further"] = [
                {"sd": t.sd, "length": t.length} | ({"wavelength": t.wavelength} if t.turns else {})
                for t in self.further
            ]
        return numbers

    @property
    def correlated_sd(self) -> float:
        """Standard deviation of all correlated parts together, m."""
        return float(np.sqrt(self.correlated**2 + sum(t.sd**2 for t in self.further)))

    @property
    def longest(self) -> float:
        """The longest correlation length, m; 0 for white noise."""
        return max((t.length for t in self.terms), default=0.0)

    @property
    def sd(self) -> float:
        """Standard deviation of a single sample, m."""
        return float(np.hypot(self.white, self.correlated_sd))

    def scaled(self, height: float = 1.0, path: float = 1.0, white: float = 1.0) -> Noise:
        """The noise with its levels and lengths so many times as large, and the white level `white` times that."""
        further = tuple(Term(t.sd * height, t.length * path, t.wavelength * path) for t in self.further)
        return Noise(self.white * height * white, self.correlated * height, self.length * path, further, self.levels)

    def of_passes(self, count: int) -> Noise:
        """Of the samples of so many passes over one place: the correlated parts average out, not along a pass."""
        return replace(self.scaled(count**-0.5), white=self.white)

    def rounded(self, step: float) -> Noise:
        """This noise together with that of positions rounded to a step, m.

        What a finger that moves along one step shows is no measure of it: on a flank each sample falls elsewhere
        within its step, and is wrong by up to half of it. Samples within a step of each other are wrong together,
        however many there are where the finger is slow. The two correlated parts are joined into one of the same
        variance and of the same weight in long means.
        """
        if step == 0.0:
            return self
        own, rounding = self.correlated**2, step**2 / 12.0
        length = (own * self.length + rounding * step) / (own + rounding)
        levels = None if self.levels is None else self.levels.beside(rounding / (self.sd**2 + rounding))
        return Noise(self.white, float(np.sqrt(own + rounding)), length, self.further, levels)

    def covariance(self, s: ArrayLike) -> FloatArray:
        """(N, N) covariance of samples at arclengths s (N,), m^2."""
        s = np.asarray(s, dtype=np.float64)
        lag = np.abs(s[:, None] - s[None, :])
        out = self.white**2 * np.eye(len(s))
        for t in self.terms:
            out += t.sd**2 * np.exp(-t.rate * lag).real
        return np.asarray(out)

    def density(self, frequency: FloatArray, spacing: float) -> FloatArray:
        """Two-sided spectral density at angular frequencies, rad/m, of samples so far apart, m^3.

        Reference: theory equation 6.2.
        """
        out = np.full(np.shape(frequency), self.white**2 * spacing)
        for t in self.terms:
            out += 2.0 * t.sd**2 * (t.rate / (t.rate**2 + np.asarray(frequency) ** 2)).real
        return np.asarray(out)

    def cap_sd(self, half_width: FloatArray, spacing: float) -> FloatArray:
        """(W,) relative standard deviation, m, of the height of caps 1 - (x / w)^2 of these half-widths, m.

        White noise leaves the information 16 w / (15 sigma^2 Delta) on the height, a process of correlation length L
        the integral of (T'^2 L + T^2 / L) / (2 sigma^2) over the cap T (theory equations 6.9 and 6.11). Parts are
        added as if each stood alone, which is an upper bound of what they leave together; alone, a tone leaves nothing.

        Args:
            half_width: of the caps, m.
            spacing: distance of the samples, m.
        """
        w = np.asarray(half_width)
        total = self.white**2 * (15.0 * spacing / (16.0 * w))
        for t in (t for t in self.terms if not t.turns):
            total = total + t.sd**2 * 2.0 / (8.0 * t.length / (3.0 * w) + 16.0 * w / (15.0 * t.length))
        return np.asarray(np.sqrt(total))

    def block_covariances(self, count: int, block: float, samples: float) -> FloatArray:
        """(count,) autocovariance of means over adjoining blocks, at lags 0 to count - 1 blocks.

        Args:
            block: length of a block, m.
            samples: number of samples in a block; may be fractional on average.
        """
        lags = np.maximum(np.arange(count) - 1, 0)
        covariances, own = np.zeros(count), self.white**2 / samples
        for t in self.terms:
            # real numbers where nothing turns: three times as quick
            x = block * (t.rate if t.turns else 1.0 / t.length)
            rise = -np.expm1(-x) / x
            covariances += np.real((t.sd * rise) ** 2 * np.exp(-lags * x))
            own += t.sd**2 * float(_mean_variance(np.array(x)).real)
        covariances[0] = own
        return covariances

    def block_filter(self, count: int, block: float, samples: float) -> Filter:
        """What whitens means over adjoining blocks in O(count); the arguments as of `block_covariances`."""
        steps = mean_steps(self.terms, np.array([block]), np.array([self.white**2 / samples]))
        return steps.filter(np.zeros(count, dtype=np.int64), np.arange(count) == 0, np.ones(count, dtype=bool))

    def whiten(self, values: ArrayLike, s: ArrayLike) -> tuple[FloatArray, float]:
        """Values as seen by independent unit noise, in O(N).

        The innovations of the Kalman filter of the process: W v with W^T W the inverse covariance, so that the
        log-likelihood of a residual v is -0.5 |W v|^2 - 0.5 logdet - 0.5 N log(2 pi).

        Args:
            values: (N,) or (N, P) columns, m.
            s: (N,) arclengths, m, increasing.

        Returns:
            The whitened columns in the shape of `values`, and the log-determinant of the covariance.

        Raises:
            NoiseError: shapes that do not match, or a noise of level zero.
        """
        columns = np.asarray(values, dtype=np.float64)
        positions = np.asarray(s, dtype=np.float64)
        if columns.shape[:1] != positions.shape:
            raise NoiseError(f"values and s must have one length; found {columns.shape} and {positions.shape}")
        if self.white == 0 and (not self.terms or (np.diff(positions) == 0).any()):
            raise NoiseError(
                "cannot whiten: the covariance is singular (no white noise and repeated or certain samples)"
            )
        if not self.terms:
            return columns / self.white, 2 * len(positions) * float(np.log(self.white))
        count = len(positions)
        steps = point_steps(self.terms, self.white, np.diff(positions, prepend=positions[:1]))
        filter_ = steps.filter(np.arange(count), np.arange(count) == 0, np.ones(count, dtype=bool))
        whitened = filter_.whiten(np.ascontiguousarray(columns.reshape(count, -1).T))
        return np.ascontiguousarray(whitened.T).reshape(columns.shape), filter_.logdet


def least_noise(heights: FloatArray, tip_radius: float) -> float:
    """Standard deviation (m) below which no noise of heights or places (N, ...), m, is told from rounding."""
    return max(CONTACT_ROUNDING * tip_radius, LEAST_DIGITS * float(np.abs(heights).max(initial=0.0)))


def estimate_noise(residual: ArrayLike, s: ArrayLike) -> Noise:
    """Level and correlation of the noise in a residual that may hold features.

    The difference of adjoining block means (the Allan deviation; theory section 6.1) knows no offset and little
    drift; its median absolute value at every block length knows little of features that cover a small part of the
    path. The three parameters are fitted to it.

    Args:
        residual: (N,) heights over the base, m; N >= 16. May be several sweeps in a row.
        s: (N,) arclengths, m, increasing within a sweep; a jump or a decrease begins another sweep.

    Raises:
        NoiseError: different lengths, or too few samples.
    """
    residual, s = np.asarray(residual, dtype=np.float64), np.asarray(s, dtype=np.float64)
    if residual.ndim != 1 or residual.shape != s.shape:
        raise NoiseError(f"residual and s must have shape (N,); found {residual.shape} and {s.shape}")
    if len(s) < 16:
        raise NoiseError(f"the noise needs at least 16 samples to be estimated; found {len(s)}")
    blocks, variances, counts, spacing = _allan_variances(residual, s)
    return _fit_allan(blocks, variances, counts, spacing)


def _mean_variance(x: FloatArray) -> FloatArray:
    """Variance of the mean of a unit process over x = rate times length; series where the form cancels."""
    near = np.abs(x) < SERIES_LIMIT
    if not near.any():
        return np.asarray(2 * ((x + np.expm1(-x)) / x) / x)
    safe, close = np.where(near, SERIES_LIMIT, x), np.where(near, x, SERIES_LIMIT)
    series = np.polynomial.polynomial.polyval(close, 2.0 * SIGNS / FACTORIALS)
    return np.where(near, series, 2 * ((safe + np.expm1(-safe)) / safe) / safe)


def _allan_of_ou(x: FloatArray) -> FloatArray:
    """Half the mean square difference of adjoining means of a unit OU process over x correlation lengths."""
    safe = np.maximum(x, SERIES_LIMIT)
    full = _mean_variance(safe) - (np.expm1(-safe) / safe) ** 2
    coefficients = SIGNS * (4.0 - 2.0 ** (SERIES_POWERS + 2)) / FACTORIALS
    return np.where(x < SERIES_LIMIT, np.polynomial.polynomial.polyval(np.minimum(x, SERIES_LIMIT), coefficients), full)


def _allan_variances(residual: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Robust Allan variances at geometric block sizes: samples per block, variances, independent pairs, spacing."""
    steps = np.diff(s)
    spacing = float(np.median(steps[steps > 0])) if (steps > 0).any() else 1.0
    begins = np.flatnonzero((steps < 0) | (steps > 20 * spacing)) + 1
    runs = [run - run[0] for run in np.split(residual, begins) if len(run) >= 2]
    sizes, variances, counts = [], [], []
    size = 1
    while True:
        differences = [_block_differences(run, size) for run in runs if len(run) >= 2 * size]
        together = np.concatenate(differences) if differences else np.zeros(0)
        independent = sum(len(run) // (2 * size) for run in runs)
        if size > 1 and independent < 12:
            break
        sizes.append(size)
        variances.append(0.5 * robust_sd(together) ** 2)
        counts.append(independent)
        size = int(np.ceil(size * 1.6))
    return np.array(sizes, dtype=float), np.array(variances), np.array(counts, dtype=float), spacing


def _block_differences(run: FloatArray, size: int) -> FloatArray:
    """Differences of adjoining means over `size` samples, at every quarter block."""
    sums = np.concatenate([[0.0], np.cumsum(run)])
    means = (sums[size:] - sums[:-size]) / size
    return np.asarray(means[size:] - means[:-size])[:: max(1, size // 4)]


def _fit_allan(sizes: FloatArray, variances: FloatArray, counts: FloatArray, spacing: float) -> Noise:
    """Non-negative fit of white and correlated variance for every correlation length; the best of them."""
    scale = variances.max()
    if scale == 0:
        return Noise(0.0)
    # relative error of a variance from n pairs by the median is about sqrt(5.4 / n); features and drift disturb the
    # long blocks, so none is trusted better than 3 %
    weight = 1 / np.sqrt(5.4 / counts + 0.03**2)
    white = 1 / sizes
    target = variances / scale
    level = _ratio(target, white, weight)
    alone = float(_misfit(target, level * white, weight))
    lengths = spacing * np.geomspace(2.0, max(2.5, sizes[-1]), 60)
    correlated = _allan_of_ou(sizes * spacing / lengths[:, None])
    a, b = _two_levels(target, white, correlated, weight)
    misfit = np.where(b > 0, _misfit(target, a[:, None] * white + b[:, None] * correlated, weight), np.inf)
    best = int(misfit.argmin())
    if misfit[best] > alone - LEAST_CHI_SQUARE_GAIN:
        return Noise(float(np.sqrt(level * scale)), 0.0, spacing)
    return Noise(float(np.sqrt(a[best] * scale)), float(np.sqrt(b[best] * scale)), float(lengths[best]))


def _ratio(target: FloatArray, shape: FloatArray, weight: FloatArray) -> float:
    """Level of one shape in the relative sense, by reweighting with the model itself."""
    safe = np.maximum(target, 1e-12)
    return float(np.exp(np.average(np.log(safe / shape), weights=weight**2)))


def _two_levels(
    target: FloatArray, white: FloatArray, correlated: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Non-negative levels (K,) of both shapes with the least weighted relative error, reweighted by the model.

    One pair for each of K correlated shapes (K, n), from the normal equations of two unknowns.
    """
    floor = 1e-9 * target.max()
    model = np.broadcast_to(target, correlated.shape)
    for _ in range(4):
        w = (weight / np.maximum(model, floor)) ** 2
        ww, wc, cc = (np.sum(w * product, axis=1) for product in (white * white, white * correlated, correlated**2))
        wt, ct = np.sum(w * white * target, axis=1), np.sum(w * correlated * target, axis=1)
        # two shapes that differ by rounding alone have no levels of their own: any finite ones will do
        determinant = np.maximum(ww * cc - wc * wc, 1e-14 * ww * cc + np.finfo(float).tiny)
        a, b = (cc * wt - wc * ct) / determinant, (ww * ct - wc * wt) / determinant
        a, b = np.where(b < 0, wt / ww, np.where(a < 0, 0.0, a)), np.where(a < 0, ct / cc, np.where(b < 0, 0.0, b))
        model = np.maximum(a[:, None] * white + b[:, None] * correlated, floor)
    return np.asarray(a), np.asarray(b)


def _misfit(target: FloatArray, model: FloatArray, weight: FloatArray) -> FloatArray:
    """Weighted square errors of the logarithms: chi-square of independent relative errors."""
    safe = np.maximum(target, 1e-12)
    return np.asarray(np.sum((weight * np.log(safe / np.maximum(model, 1e-12))) ** 2, axis=-1))
