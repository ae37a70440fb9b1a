"""The noise of the quiet path: what is left out of it is no noise."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Surface, Trace
from mapping.base import Base
from mapping.detection import detect
from mapping.geometry.templates import crest_trace

TIP, STEP, WHITE, CORRELATED, LENGTH = 5e-3, 50e-6, 10e-6, 20e-6, 1e-3
SWEEPS, LONG = 10, 0.2


def bare(seed: int, height: float = 0.0) -> Trace:
    """Sweeps of a plate in correlated noise, across a crest of some height in the middle."""
    from scipy.signal import lfilter

    rng = np.random.default_rng((181, seed))
    x = np.arange(0.0, LONG, STEP)
    keep, rows = float(np.exp(-STEP / LENGTH)), []
    for k in range(SWEEPS):
        kicks = CORRELATED * rng.standard_normal(len(x))
        kicks[1:] *= np.sqrt(1.0 - keep**2)
        z = TIP + lfilter([1.0], [1.0, -keep], kicks) + WHITE * rng.standard_normal(len(x))
        if height:
            z += crest_trace(np.abs(x - 0.5 * LONG), height, np.sqrt(2.0 * TIP * height))
        rows.append(np.column_stack([x, np.full(len(x), 3e-3 * k), z]))
    centers = np.concatenate(rows)
    return Trace(1e-3 * np.arange(len(centers)), centers, np.repeat(np.arange(SWEEPS), len(x)), TIP)


def density_error(trace: Trace) -> float:
    """Logarithm of the root of the fitted density at low frequencies over the true one."""
    corners = 0.3 * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    noise = detect(trace, Base(Surface(corners, np.array([[0, 1, 2], [0, 2, 3]])))).noise
    return 0.5 * float(np.log(noise.correlated**2 * noise.length / (CORRELATED**2 * LENGTH)))


@pytest.mark.slow
@pytest.mark.parametrize("height", [0.0, 0.4e-3])
def test_the_highest_of_the_noise_is_not_left_out_of_its_own_estimate(height: float) -> None:
    """One estimate scatters by 0.037 (2 m of a process over 1 mm); with the highest left out it was 0.056 too low."""
    errors = [density_error(bare(seed, height)) for seed in range(12)]
    assert abs(np.mean(errors)) < 2.5 * 0.037 / np.sqrt(len(errors))
