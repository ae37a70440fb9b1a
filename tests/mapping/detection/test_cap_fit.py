"""Cap fit: what a filter of the noise lets be seen of caps is what the whole covariance says."""

import numpy as np
import pytest

from mapping.detection.filters import cap_products, caps
from mapping.instrument import Noise, Term

PROCESS = Noise(1e-5, 2e-6, 1e-3)
TURNING = Noise.of_terms(1e-5, [Term(2e-6, 1e-3), Term(1e-5, 2e-3, 5e-4)])
STEP, COUNT, SAMPLES = 1e-4, 90, 3.0


@pytest.mark.parametrize("drift", [0, 2])
@pytest.mark.parametrize("noise", [Noise(1e-5, 0.0), PROCESS, TURNING])
def test_many_caps_fit_as_each_does_by_the_whole_covariance(noise, drift):
    rng = np.random.default_rng(1)
    place, half_width = rng.uniform(-1e-3, 1e-2, 75), rng.uniform(5e-4, 8e-3, 75)
    flat = half_width * rng.choice([0.0, 0.5, 0.95], 75)
    filter_ = noise.block_filter(COUNT, STEP, SAMPLES)
    free = np.arange(COUNT) ** np.arange(drift)[:, None]
    basis = np.linalg.qr(filter_.whiten(free.astype(float)).T)[0]
    heights = 1e-4 * rng.normal(size=COUNT)
    seen = filter_.whiten(heights[None])[0]
    values, steps = seen - basis @ (basis.T @ seen), filter_.steps
    found = cap_products(
        0.0,
        STEP,
        place,
        half_width,
        flat,
        values,
        basis,
        steps.observe,
        steps.carry,
        steps.turn,
        filter_.gain,
        filter_.scale,
    )
    lags = np.abs(np.subtract.outer(np.arange(COUNT), np.arange(COUNT)))
    inverse = np.linalg.inv(noise.block_covariances(COUNT, STEP, SAMPLES)[lags])
    inverse = inverse - inverse @ free.T @ np.linalg.solve(free @ inverse @ free.T, free @ inverse)
    shapes = caps(0.0, STEP, COUNT, place, half_width, flat)
    squares = np.einsum("ci,ij,cj->c", shapes, inverse, shapes)
    np.testing.assert_allclose(found[:, 0], squares, rtol=1e-8, atol=1e-8 * squares.max())
    np.testing.assert_allclose(
        found[:, 1], shapes @ inverse @ heights, rtol=1e-7, atol=1e-7 * np.abs(found[:, 1]).max()
    )
