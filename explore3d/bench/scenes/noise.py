"""Noise of a known law along simulated sweeps."""

from __future__ import annotations

import numpy as np

from mapping import FloatArray
from mapping.instrument import Noise

SAMPLE_SPACING = 6e-6


def simulate_noise(noise: Noise, paths: list[FloatArray], rng: np.random.Generator) -> FloatArray:
    """(N,) white plus Ornstein-Uhlenbeck noise along each path, m."""
    from scipy.signal import lfilter

    parts = []
    for path in paths:
        white = noise.white * rng.standard_normal(len(path))
        keep = np.exp(-SAMPLE_SPACING / noise.length)
        kicks = np.sqrt(1.0 - keep**2) * rng.standard_normal(len(path))
        kicks[0] = rng.standard_normal()
        parts.append(white + noise.correlated * lfilter([1.0], [1.0, -keep], kicks))
    return np.concatenate(parts)
