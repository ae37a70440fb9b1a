"""Noise fit: the most likely level and correlation of the noise in block means, and how well they are known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapping import FloatArray
from mapping.instrument.noise import Noise
from mapping.instrument.stated import StatedNoise

# A correlated part must raise twice the log-likelihood by this much over white noise alone.
LEAST_LIKELIHOOD_GAIN = 8.0
# Standard deviation, in natural logarithms, of what is known of a parameter before anything is measured.
IGNORANCE = 2.0
# Longest correlation, in lengths of the whole path, that the path can tell from an offset of the base.
LONGEST = 0.25
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


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """A noise and the uncertainty of its parameters.

    Args:
        noise: the most likely one.
        covariance: (3, 3) of the natural logarithms of white^2, correlated^2 and length.
    """

    noise: Noise
    covariance: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))


def fit_noise(blocks: Sequence[Blocks], start: Noise, stated: StatedNoise | None = None) -> NoiseFit:
    """The most likely white + OU noise, from any start within about a decade; the start where none is found.

    Args:
        blocks: what was measured, on one or more scales.
        start: a first estimate (see `estimate_noise`).
        stated: what was known before, or None.
    """
    count = sum(int(np.isfinite(b.values).sum()) for b in blocks)
    white = _white_alone(blocks)
    if count < 32 or white == 0:
        return NoiseFit(start)
    # units near the data's own, by powers of two: logarithms then see the same digits at every scale
    height = float(np.exp2(np.round(np.log2(white))))
    longest = max(float(np.abs(b.steps).max(initial=0.0)) for b in blocks)
    path = float(np.exp2(np.round(np.log2(longest))))
    fit = _unit_fit(
        [Blocks(b.values / height, b.steps / path, b.samples) for b in blocks],
        Noise(start.white / height, start.correlated / height, start.length / path),
        None if stated is None else stated.scaled(height, path),
    )
    noise = Noise(fit.noise.white * height, fit.noise.correlated * height, fit.noise.length * path)
    if noise.correlated > 0 and noise.length > LONGEST * sum(float(np.abs(b.steps).sum()) for b in blocks):
        return NoiseFit(start)
    return replace(fit, noise=noise)


def _unit_fit(blocks: Sequence[Blocks], start: Noise, stated: StatedNoise | None) -> NoiseFit:
    """The fit in units in which levels and steps are about 1."""
    white = _white_alone(blocks)
    expected = stated.noise if stated is not None and stated.noise.correlated > 0 else None
    guess = start if start.correlated > 0 else expected or Noise(start.white or white, 0.1 * white, 10.0)
    theta, covariance, misfit = _newton(blocks, _logarithms(guess, white), stated)
    if misfit + (0.0 if expected else LEAST_LIKELIHOOD_GAIN) > _misfit(blocks, Noise(white)):
        alone = np.zeros((3, 3))
        alone[0, 0] = 2.0 / sum(int(np.isfinite(b.values).sum()) for b in blocks)
        return NoiseFit(Noise(white, 0.0, guess.length), alone)
    return NoiseFit(_noise(theta), covariance)


def relative_sd(fit: NoiseFit, gradient: FloatArray) -> float:
    """Relative standard deviation of a level that depends on the noise.

    Args:
        gradient: (3,) derivatives of the level's logarithm by those of white^2, correlated^2 and length.
    """
    return float(np.sqrt(max(float(gradient @ fit.covariance @ gradient), 0.0)))


def perturbed(noise: Noise, index: int, step: float = DIFFERENCE) -> Noise:
    """The noise with the logarithm of white^2, correlated^2 or length (index 0 to 2) raised by a step."""
    factors = [1.0, 1.0, 1.0]
    factors[index] = float(np.exp(step))
    return Noise(noise.white * factors[0] ** 0.5, noise.correlated * factors[1] ** 0.5, noise.length * factors[2])


def _newton(
    blocks: Sequence[Blocks], start: FloatArray, stated: StatedNoise | None
) -> tuple[FloatArray, FloatArray, float]:
    """Parameters, their covariance and the misfit at the most likely noise, by damped Newton steps."""

    def cost(theta: FloatArray) -> float:
        known = 0.0 if stated is None else stated.surprise(theta)
        return _misfit(blocks, _noise(theta)) + float(np.sum(((theta - start) / IGNORANCE) ** 2)) + known

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
    unit = DIFFERENCE * np.eye(3)
    up, down = np.array([cost(theta + e) for e in unit]), np.array([cost(theta - e) for e in unit])
    bend = np.diag((up + down - 2 * value) / DIFFERENCE**2)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        both = cost(theta + unit[i] + unit[j])
        bend[i, j] = bend[j, i] = (both - up[i] - up[j] + value) / DIFFERENCE**2
    return (up - down) / (2 * DIFFERENCE), bend


def _misfit(blocks: Sequence[Blocks], noise: Noise) -> float:
    """Twice the negative log-likelihood, up to a constant."""
    from mapping.instrument.noise_kernels import block_likelihood

    return float(
        sum(block_likelihood(b.values, b.steps, b.samples, noise.white, noise.correlated, noise.length) for b in blocks)
    )


def _white_alone(blocks: Sequence[Blocks]) -> float:
    """The most likely level of white noise alone."""
    total = sum(b.samples * float(np.nansum(b.values**2)) for b in blocks)
    count = sum(int(np.isfinite(b.values).sum()) for b in blocks)
    return float(np.sqrt(total / max(count, 1)))


def _logarithms(noise: Noise, scale: float) -> FloatArray:
    white, correlated = (max(level, 1e-2 * scale) for level in (noise.white, noise.correlated))
    return np.asarray(np.log([white**2, correlated**2, noise.length]))


def _noise(theta: FloatArray) -> Noise:
    white, correlated, length = np.exp(np.clip(theta, -600, 600) * [0.5, 0.5, 1.0])
    return Noise(float(white), float(correlated), float(length))
