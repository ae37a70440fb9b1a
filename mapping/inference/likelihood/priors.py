"""Priors of single parameters: densities, draws, and pseudo-residuals for least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mapping import FloatArray


class Prior(Protocol):
    """A proper prior on one parameter with support [low, high]."""

    @property
    def low(self) -> float: ...

    @property
    def high(self) -> float: ...

    def log_density(self, x: FloatArray) -> FloatArray:
        """Normalised log density within the support."""
        ...

    def residual(self, x: FloatArray) -> FloatArray:
        """Value whose square is -2 log density up to a constant."""
        ...

    def draw(self, rng: np.random.Generator, size: int) -> FloatArray:
        """(size,) independent draws."""
        ...


@dataclass(frozen=True)
class Uniform:
    """Equally probable between low and high."""

    low: float
    high: float

    def log_density(self, x: FloatArray) -> FloatArray:
        return np.full(np.shape(x), -np.log(self.high - self.low))

    def residual(self, x: FloatArray) -> FloatArray:
        return np.zeros(np.shape(x))

    def draw(self, rng: np.random.Generator, size: int) -> FloatArray:
        return rng.uniform(self.low, self.high, size)


@dataclass(frozen=True)
class LogOfUniform:
    """The logarithm of what is equally probable between exp(low) and exp(high)."""

    low: float
    high: float

    def log_density(self, x: FloatArray) -> FloatArray:
        return np.asarray(np.asarray(x) - self.high - np.log1p(-np.exp(self.low - self.high)))

    def residual(self, x: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(2.0 * np.maximum(self.high - np.asarray(x), 0.0)))

    def draw(self, rng: np.random.Generator, size: int) -> FloatArray:
        return np.asarray(np.log(rng.uniform(np.exp(self.low), np.exp(self.high), size)))


@dataclass(frozen=True)
class StudentT:
    """Student's t with few degrees of freedom: sure of little, overruled by data far out."""

    center: float
    scale: float
    degrees: float = 4.0
    low: float = -np.inf
    high: float = np.inf

    def log_density(self, x: FloatArray) -> FloatArray:
        from math import lgamma, log, pi

        nu = self.degrees
        norm = lgamma((nu + 1) / 2) - lgamma(nu / 2) - 0.5 * log(nu * pi) - log(self.scale)
        return norm - 0.5 * self.residual(x) ** 2

    def residual(self, x: FloatArray) -> FloatArray:
        z = (x - self.center) / self.scale
        return np.asarray(np.sign(z) * np.sqrt((self.degrees + 1) * np.log1p(z**2 / self.degrees)))

    def draw(self, rng: np.random.Generator, size: int) -> FloatArray:
        return np.asarray(self.center + self.scale * rng.standard_t(self.degrees, size))


@dataclass(frozen=True)
class Normal:
    """Gaussian."""

    mean: float
    sd: float
    low: float = -np.inf
    high: float = np.inf

    def log_density(self, x: FloatArray) -> FloatArray:
        return np.asarray(-0.5 * self.residual(x) ** 2 - np.log(self.sd * np.sqrt(2 * np.pi)))

    def residual(self, x: FloatArray) -> FloatArray:
        return np.asarray((x - self.mean) / self.sd)

    def draw(self, rng: np.random.Generator, size: int) -> FloatArray:
        return rng.normal(self.mean, self.sd, size)
