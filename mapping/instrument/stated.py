"""Stated noise: what is known of the noise before anything is measured, say from a sensor's data sheet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mapping import FloatArray, NoiseError
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
        noise = Noise(self.noise.white / height, self.noise.correlated / height, self.noise.length / path)
        return replace(self, noise=noise)

    def surprise(self, theta: FloatArray) -> float:
        """Twice the negative logarithm of its density (Student's t in each logarithm), up to a constant."""
        total = 0.0
        if self.noise.white > 0:
            total += _tail((theta[0] - 2 * np.log(self.noise.white)) / (2 * self.doubt))
        if self.noise.correlated > 0:
            total += _tail((theta[1] - 2 * np.log(self.noise.correlated)) / (2 * self.doubt))
            total += _tail((theta[2] - np.log(self.noise.length)) / self.doubt)
        return total


def _tail(deviation: float) -> float:
    return float((STATED_TAIL_FREEDOM + 1) * np.log1p(deviation**2 / STATED_TAIL_FREEDOM))
