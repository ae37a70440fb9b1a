"""Stated noise: what is known of the noise before anything is measured, say from a sensor's data sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import NoiseError
from mapping.instrument.noise import Noise

# Degrees of freedom of what is stated (1: Cauchy's): its tails let measurements that contradict it prevail.
STATED_TAIL_FREEDOM = 1.0


@dataclass(frozen=True)
class StatedNoise:
    """What is known of the noise before anything is measured.

    Args:
        noise: as stated; a part of level 0 is not stated at all.
        doubt: relative standard deviation of every stated level and of the length.

    Raises:
        NoiseError: a doubt that is not positive and finite.
    """

    noise: Noise
    doubt: float = 0.1

    def __post_init__(self) -> None:
        if not (np.isfinite(self.doubt) and self.doubt > 0):
            raise NoiseError(f"the doubt about a stated noise must be positive and finite; found {self.doubt}")

    def scaled(self, height: float, path: float) -> StatedNoise:
        """The same in other units of height and path."""
        return replace(self, noise=self.noise.scaled(1 / height, 1 / path))

    def instead_of(self, guess: Noise) -> Noise:
        """What is stated, and of what is not, a guess."""
        law = self.noise
        if law.correlated > 0:
            guess = replace(guess, correlated=law.correlated, length=law.length)
        return replace(guess, white=law.white) if law.white > 0 else guess

    def surprise(self, noise: Noise) -> float:
        """Twice the negative logarithm of a noise's density (Student's t in each logarithm), up to a constant."""
        total, least = 0.0, np.finfo(float).tiny
        if self.noise.white > 0:
            total += _tail(float(np.log(max(noise.white, least) / self.noise.white)) / self.doubt)
        if self.noise.correlated > 0:
            total += _tail(float(np.log(max(noise.correlated, least) / self.noise.correlated)) / self.doubt)
            total += _tail(float(np.log(noise.length / self.noise.length)) / self.doubt)
        return total


def _tail(deviation: float) -> float:
    return float((STATED_TAIL_FREEDOM + 1) * np.log1p(deviation**2 / STATED_TAIL_FREEDOM))
