"""States: the correlated terms of a noise as hidden states that step along a path (theory section 6.9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mapping import BoolArray, FloatArray, IntArray
from mapping.instrument.term import Term

ComplexArray = npt.NDArray[np.complex128]

# Correlation lengths (and turns) of a step below which the variance of its mean cancels; there three terms of its
# series leave a 1e-7th of what the step adds.
SHORT_STEP = 1e-3


@dataclass(frozen=True, eq=False)
class Steps:
    """What a noise does over steps of a path, K of them, for D states of which the first P pairs turn.

    Args:
        observe: (K, D) weights of the states before the step in what is read.
        spread: (K,) variance of what is read, given these states, m^2.
        shared: (K, D) its covariance with the states after the step, m^2.
        carry: (K, D) by which the states decay.
        turn: (K, P) sine by which each pair turns.
        fresh: (K, D) variance that the step adds to the states, m^2.
        power: (D,) variances of the states before anything is read, m^2.
    """

    observe: FloatArray
    spread: FloatArray
    shared: FloatArray
    carry: FloatArray
    turn: FloatArray
    fresh: FloatArray
    power: FloatArray

    def filter(self, kind: IntArray, begins: BoolArray, known: BoolArray) -> Filter:
        """The Kalman filter of readings whose steps are these.

        Args:
            kind: (N,) row of the step that leads to each reading.
            begins: (N,) True where another run begins.
            known: (N,) False where nothing is read.
        """
        from mapping.instrument.noise_kernels import gains

        gain, scale = gains(
            kind,
            begins,
            known,
            self.observe,
            self.spread,
            self.shared,
            self.carry,
            self.turn,
            self.fresh,
            self.power,
        )
        return Filter(self, kind, begins, gain, scale)


@dataclass(frozen=True, eq=False)
class Filter:
    """The filter of so many readings; its gains do not depend on what is read.

    Args:
        steps: of the noise.
        kind, begins: (N,) as in `Steps.filter`.
        gain: (N, D).
        scale: (N,) one over the standard deviation of each innovation, 1/m; 0 where nothing is read.
    """

    steps: Steps
    kind: IntArray
    begins: BoolArray
    gain: FloatArray
    scale: FloatArray

    def whiten(self, values: FloatArray) -> FloatArray:
        """Unit independent noise (W, N) from W series (W, N), m; 0 where nothing is read."""
        from mapping.instrument.noise_kernels import innovations

        s, values = self.steps, np.ascontiguousarray(values)
        return np.asarray(
            innovations(values, self.kind, self.begins, s.observe, s.carry, s.turn, self.gain, self.scale)
        )

    @property
    def logdet(self) -> float:
        """Logarithm of the determinant of the covariance of what is read."""
        return -2.0 * float(np.log(self.scale[self.scale > 0.0]).sum())


def ordered(terms: Sequence[Term]) -> list[Term]:
    """The terms as their states are ordered: oscillators first."""
    return [t for t in terms if t.turns] + [t for t in terms if not t.turns]


def point_steps(terms: Sequence[Term], white: float, step: FloatArray) -> Steps:
    """Steps (K,) m from sample to sample, each read at its end beside white noise of this level, m."""
    terms = ordered(terms)
    x = _rates(terms)[:, None] * step
    carry = np.exp(-x)
    power = np.array([t.sd**2 for t in terms])[:, None]
    fresh = -power * np.expm1(-2.0 * x.real)
    spread = white**2 + fresh.sum(axis=0)
    # what is read is the real part after the step
    return _stacked(terms, np.conj(carry), spread, fresh.astype(np.complex128), carry, fresh)


def mean_steps(terms: Sequence[Term], step: FloatArray, own: FloatArray, count: FloatArray | None = None) -> Steps:
    """Steps (K,) m, of which the mean is read (theory equation 6.17).

    Args:
        terms: of the noise.
        step: lengths over which the means are taken, m.
        own: (K,) variance of the mean's independent part, m^2.
        count: (K,) evenly spaced samples in each mean, the last of them at its end; None: means of the process itself.
    """
    terms = ordered(terms)
    x = _rates(terms)[:, None] * np.maximum(step, np.finfo(float).tiny)
    power = np.array([t.sd**2 for t in terms])[:, None]
    carry, lost = np.exp(-x), -np.expm1(-x)
    short = np.abs(x) < SHORT_STEP
    far = np.where(short, SHORT_STEP, x)
    if count is None:
        pull = end = lost / x
        mean = np.where(short, 1.0 - x / 3.0 + x**2 / 12.0, 2.0 * (far + np.expm1(-far)) / far**2)
    else:
        # sums over the powers of q = exp(-x / count)
        first = np.asarray(-np.expm1(-x / count), dtype=np.complex128)
        pull = (1.0 - first) * lost / (count * first)
        end = lost / (count * first)
        lone = -np.expm1(-far / count)
        mean = np.where(
            short,
            1.0 - x * (count**2 - 1.0) / (3.0 * count**2) + x**2 * (count**2 - 1.0) / (12.0 * count**2),
            (2.0 - lone) / (count * lone) + 2.0 * (1.0 - lone) * np.expm1(-far) / (count * lone) ** 2,
        )
    spread = np.maximum(power * (mean.real - np.abs(pull) ** 2), 0.0)
    shared = power * (end - carry * np.conj(pull))
    fresh = -power * np.expm1(-2.0 * x.real)
    # Re(pull z) of the complex state z = a + i b is Re(pull) a - Im(pull) b
    return _stacked(terms, np.conj(pull), own + spread.sum(axis=0), shared, carry, fresh)


def _rates(terms: Sequence[Term]) -> ComplexArray:
    """(T,) complex 1 / length + 2 pi i / wavelength of the terms, 1/m."""
    return np.array([complex(1.0 / t.length, 2.0 * np.pi / t.wavelength) for t in terms], dtype=np.complex128)


def _stacked(
    terms: Sequence[Term],
    observe: ComplexArray,
    spread: FloatArray,
    shared: ComplexArray,
    carry: ComplexArray,
    fresh: FloatArray,
) -> Steps:
    """States from complex terms (T, K): real and imaginary part of an oscillator, the real part of a process."""
    pairs = sum(t.turns for t in terms)

    def states(values: FloatArray, turned: FloatArray) -> FloatArray:
        both = np.stack([values[:pairs], turned[:pairs]], axis=1).reshape(2 * pairs, values.shape[1])
        return np.ascontiguousarray(np.concatenate([both, values[pairs:]]).T)

    return Steps(
        states(observe.real, observe.imag),
        np.ascontiguousarray(spread),
        states(shared.real, shared.imag),
        states(carry.real, carry.real),
        np.ascontiguousarray(-carry.imag[:pairs].T),
        states(fresh, fresh),
        np.array([t.sd**2 for t in terms for _ in range(2 if t.turns else 1)]),
    )
