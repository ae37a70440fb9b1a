"""Profiles of a few hundred samples, written as the tables of a stylus instrument."""

from __future__ import annotations

from pathlib import Path

import numpy as np

TIP = 2e-6
STEP = 0.5e-6


def heights(seed: int, samples: int, crest: float, noise: float = 10e-9) -> np.ndarray:
    """(N,) heights of a tilted line with a round crest in each third of it, m."""
    rng = np.random.default_rng(seed)
    x = STEP * np.arange(samples)
    z = np.zeros(samples)
    for third in (1, 2):
        middle = x[-1] * (third / 3.0 + 0.02 * rng.standard_normal())
        z = np.maximum(z, crest - (x - middle) ** 2 / (2.0 * (TIP + 4e-6)))
    return z + 1e-3 * x + noise * rng.standard_normal(samples)


def write_profile(path: Path, seed: int = 0, samples: int = 400, crest: float = 1e-6) -> Path:
    """A table of x and z in mm."""
    x = STEP * np.arange(samples)
    rows = 1e3 * np.column_stack([x, heights(seed, samples, crest)])
    np.savetxt(path, rows, delimiter=",", header="x [mm],z [mm]", comments="", fmt="%.9f")
    return path
