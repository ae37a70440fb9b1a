"""NoiseSource: the noise of the paper's apparatus, drawn for one sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapping import FloatArray


@dataclass(frozen=True)
class NoiseSource:
    """White noise plus a stationary Ornstein-Uhlenbeck process along the path (theory section 6).

    Every component of the ball's centre gets its own draws, so the noise is isotropic: its standard
    deviation along the surface's normal is sqrt(white^2 + correlated^2).

    Args:
        white: standard deviation of each component from sample to sample, m.
        correlated: stationary standard deviation of the correlated part of each component, m.
        correlation_length: distance over which its correlation falls by e, m.
        angle: standard deviation of the contact normal about each of two tangent axes, rad.
        contact: standard deviation of each component of the contact point, m.
    """

    white: float = 0.0
    correlated: float = 0.0
    correlation_length: float = 1e-3
    angle: float = 0.0
    contact: float = 0.0

    def of_centers(self, rng: np.random.Generator, count: int, spacing: float) -> FloatArray:
        """(count, 3) displacement of centres that lie `spacing` metres apart along the path, m."""
        noise = self.white * rng.standard_normal((count, 3))
        if self.correlated > 0 and count:
            noise += ornstein_uhlenbeck(rng, (count, 3), spacing / self.correlation_length, self.correlated)
        return noise

    def of_normals(self, rng: np.random.Generator, normals: FloatArray) -> FloatArray:
        """(N, 3) unit normals tilted by the angle noise."""
        tilt = self.angle * rng.standard_normal(normals.shape)
        tilted = normals + tilt - (tilt * normals).sum(axis=1, keepdims=True) * normals
        return np.asarray(tilted / np.linalg.norm(tilted, axis=1, keepdims=True))

    def of_contacts(self, rng: np.random.Generator, count: int) -> FloatArray:
        """(count, 3) displacement of contact points, m."""
        return self.contact * rng.standard_normal((count, 3))


def ornstein_uhlenbeck(rng: np.random.Generator, shape: tuple[int, int], step: float, deviation: float) -> FloatArray:
    """Stationary paths (N, M) with covariance deviation^2 exp(-|i - j| step), exact for any step."""
    from hw.simulated.noise_kernels import decaying_sum

    keep = float(np.exp(-step))
    drive = rng.standard_normal(shape)
    # -expm1 keeps the innovation accurate when the samples lie much closer than the correlation length
    drive[1:] *= np.sqrt(-np.expm1(-2.0 * step))
    decaying_sum(drive, keep)
    return np.asarray(deviation * drive)
