"""Block likelihood: of means over blocks under any law of noise, and the most likely law of so many terms."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from mapping import FloatArray, IntArray
from mapping.instrument.noise import Noise
from mapping.instrument.stated import StatedNoise
from mapping.instrument.states import mean_steps
from mapping.instrument.term import Term

# Standard deviation, in natural logarithms, of what is known of a parameter before anything is measured.
IGNORANCE = 2.0
# Longest correlation of a further term, in runs: beyond, it is one value, or one wave, in each.
RUNS = 10.0
NEWTON_STEPS = 12
# Steps of the numerical derivatives, in natural logarithms: the likelihood bends over 0.1 and more.
DIFFERENCE = 0.02


@dataclass(frozen=True, eq=False)
class Blocks:
    """Means over adjoining blocks of samples.

    Args:
        values: (N,) heights over the base, m; NaN where a feature is or may be.
        steps: (N,) lengths of path that the blocks cover, m; negative where another run begins.
        samples: in a block.
    """

    values: FloatArray
    steps: FloatArray
    samples: float

    @cached_property
    def kinds(self) -> tuple[FloatArray, IntArray]:
        """(K,) lengths that steps have, m, and (N,) which of them each has."""
        step, kind = np.unique(np.abs(self.steps), return_inverse=True)
        return step, kind


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """A noise and the uncertainty of its parameters.

    Args:
        noise: the most likely one.
        covariance: (P, P) of the natural logarithms of white^2, correlated^2 and length, and of sd^2, length and, if it
            turns, wavelength of each further term.
    """

    noise: Noise
    covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))


def relative_sd(fit: NoiseFit, gradient: FloatArray) -> float:
    """Relative standard deviation of a level that depends on the noise.

    Args:
        gradient: (P,) derivatives of the level's logarithm by the parameters of `NoiseFit.covariance`.
    """
    return float(np.sqrt(max(float(gradient @ fit.covariance @ gradient), 0.0)))


def perturbed(noise: Noise, index: int, step: float = DIFFERENCE) -> Noise:
    """The noise with the logarithm of one parameter of `NoiseFit.covariance` raised by a step."""
    factors = [1.0, 1.0, 1.0]
    if index < 3:
        factors[index] = float(np.exp(step))
        white, correlated, length = factors
        return replace(
            noise,
            white=noise.white * white**0.5,
            correlated=noise.correlated * correlated**0.5,
            length=noise.length * length,
        )
    terms, index = list(noise.further), index - 3
    for k, t in enumerate(terms):
        count = 3 if t.turns else 2
        if index < count:
            factors[index] = float(np.exp(step))
            sd, length, wavelength = factors
            terms[k] = Term(t.sd * sd**0.5, t.length * length, t.wavelength * wavelength)
            break
        index -= count
    return replace(noise, further=tuple(terms))


@dataclass(frozen=True, eq=False)
class _Law:
    """Which terms a noise has, and its parameters: natural logarithms, each in units that the likelihood bends over.

    Args:
        of: a noise of these terms.
        level: of all that was measured, m; no level begins below a hundredth of it.
        run: length over which a wave can be told from one that is a turn longer, m.
    """

    of: Noise
    level: float
    run: float

    @property
    def units(self) -> FloatArray:
        """(P,) logarithms that each parameter is measured in: 1, and of a wavelength what one run resolves."""
        units = [1.0] * (3 if self.of.correlated > 0 or not self.of.further else 1)
        for t in self.of.further:
            units += [1.0, 1.0] + [min(1.0, t.wavelength / self.run)] * t.turns
        return np.array(units)

    @property
    def parameters(self) -> FloatArray:
        """(P,) of this noise."""
        least = 1e-2 * self.level
        theta = [max(self.of.white, least) ** 2]
        if self.of.correlated > 0 or not self.of.further:
            theta += [max(self.of.correlated, least) ** 2, self.of.length]
        for t in self.of.further:
            theta += [t.sd**2, t.length] + [t.wavelength] * t.turns
        return np.log(theta) / self.units

    def noise(self, theta: FloatArray) -> Noise:
        """The noise of parameters (P,)."""
        values = iter(np.exp(np.clip(theta * self.units, -600, 600)).tolist())
        white, correlated, length = next(values) ** 0.5, 0.0, self.of.length
        if self.of.correlated > 0 or not self.of.further:
            correlated, length = next(values) ** 0.5, next(values)
        longest = RUNS * self.run
        further = tuple(
            Term(next(values) ** 0.5, min(next(values), longest), next(values) if t.turns else np.inf)
            for t in self.of.further
        )
        return Noise(white, correlated, length, further)

    def of_all(self, covariance: FloatArray) -> FloatArray:
        """Covariance (P, P) of the logarithms, with rows of the process that this noise may not have."""
        covariance = covariance * np.outer(self.units, self.units)
        if self.of.correlated > 0 or not self.of.further:
            return covariance
        return np.insert(np.insert(covariance, 1, np.zeros((2, 1)), axis=0), [1, 1], 0.0, axis=1)


def most_likely(blocks: Sequence[Blocks], start: Noise, stated: StatedNoise | None) -> tuple[NoiseFit, float]:
    """The most likely noise of as many terms as the start, and its misfit, prior included."""
    law = _Law(start, white_alone(blocks), max(longest_run(b) for b in blocks))
    theta, covariance, misfit = _newton(blocks, law, stated)
    return NoiseFit(law.noise(theta), law.of_all(covariance)), misfit


def _newton(blocks: Sequence[Blocks], law: _Law, stated: StatedNoise | None) -> tuple[FloatArray, FloatArray, float]:
    """Parameters, their covariance and the misfit at the most likely noise, by damped Newton steps."""

    start = law.parameters

    def cost(theta: FloatArray) -> float:
        noise = law.noise(theta)
        known = 0.0 if stated is None else stated.surprise(noise)
        return law_misfit(blocks, noise) + float(np.sum(((theta - start) / IGNORANCE) ** 2)) + known

    theta, value = start, cost(start)
    for _ in range(NEWTON_STEPS):
        slope, bend = _derivatives(cost, theta, value)
        levels, axes = np.linalg.eigh(bend)
        step: FloatArray = -axes @ ((axes.T @ slope) / np.maximum(np.abs(levels), 1.0))
        step *= min(1.0, 1.0 / float(np.abs(step).max()))
        better = cost(theta + step)
        while better > value and float(np.abs(step).max()) > 1e-3:
            step = step / 3
            better = cost(theta + step)
        if better > value:
            break
        theta, gain, value = theta + step, value - better, better
        if gain < 1e-2:
            break
    _, bend = _derivatives(cost, theta, value)
    levels, axes = np.linalg.eigh(bend)
    covariance = (axes * (2.0 / np.maximum(levels, 2.0 / IGNORANCE**2))) @ axes.T
    return theta, np.asarray(covariance), value


def _derivatives(cost: Callable[[FloatArray], float], theta: FloatArray, value: float) -> tuple[FloatArray, FloatArray]:
    """Gradient and Hessian by central differences."""
    count = len(theta)
    unit = DIFFERENCE * np.eye(count)
    up, down = np.array([cost(theta + e) for e in unit]), np.array([cost(theta - e) for e in unit])
    bend = np.diag((up + down - 2 * value) / DIFFERENCE**2)
    for i, j in itertools.combinations(range(count), 2):
        both = cost(theta + unit[i] + unit[j])
        bend[i, j] = bend[j, i] = (both - up[i] - up[j] + value) / DIFFERENCE**2
    return (up - down) / (2 * DIFFERENCE), bend


def law_misfit(blocks: Sequence[Blocks], noise: Noise) -> float:
    """Twice the negative log-likelihood, up to a constant."""
    from mapping.instrument.noise_kernels import block_likelihood

    if noise.further:
        told = [whitened(b, noise) for b in blocks]
        return float(sum(e @ e + logdet for e, logdet in told))
    return float(
        sum(block_likelihood(b.values, b.steps, b.samples, noise.white, noise.correlated, noise.length) for b in blocks)
    )


def whitened(blocks: Blocks, noise: Noise) -> tuple[FloatArray, float]:
    """(N,) blocks as unit independent noise, 0 where nothing counts, and the log-determinant of their covariance."""
    step, kind = blocks.kinds
    filter_ = mean_steps(noise.terms, step, np.full(len(step), noise.white**2 / blocks.samples)).filter(
        kind, blocks.steps < 0, np.isfinite(blocks.values)
    )
    return filter_.whiten(blocks.values[None])[0], filter_.logdet


def longest_run(blocks: Blocks) -> float:
    """Length of the longest run, m."""
    begins = np.flatnonzero(blocks.steps < 0)
    return max((float(np.abs(part).sum()) for part in np.split(blocks.steps, begins[1:])), default=0.0)


def white_alone(blocks: Sequence[Blocks]) -> float:
    """The most likely level of white noise alone."""
    total = sum(b.samples * float(np.nansum(b.values**2)) for b in blocks)
    count = sum(int(np.isfinite(b.values).sum()) for b in blocks)
    return float(np.sqrt(total / max(count, 1)))
