"""Coarse samples: the printed limit holds though a crest may lie between two of them."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import FloatArray, Trace
from mapping.base import fit_base
from mapping.detection import detect
from mapping.geometry.templates import cap_height

TIP, NOISE, LINES = 1e-3, 5e-6, 12


def lines(spacing: float, crests: FloatArray, height: float, rng: np.random.Generator) -> Trace:
    """Parallel lines over a plate, each across a knife edge of the height at its own place, m."""
    x = np.arange(-40e-3, 40e-3, spacing)
    u, v = np.tile(x, LINES), np.repeat(3e-3 * np.arange(LINES), len(x))
    z = TIP + rng.normal(0.0, NOISE, len(u))
    if height > 0:
        z += cap_height(u - np.repeat(crests, len(x)), height, 0.0, TIP)
    return Trace(np.arange(len(u)) * 1e-2, np.column_stack([u, v, z]), np.repeat(np.arange(LINES), len(x)), TIP)


@pytest.mark.parametrize(
    "spacing", [0.5e-3, *(pytest.param(wide, marks=pytest.mark.slow) for wide in (0.3e-3, 0.9e-3, 1.7e-3))]
)
def test_a_crest_at_the_limit_is_seen_wherever_it_lies_between_samples(spacing: float) -> None:
    rng = np.random.default_rng(11)
    bare = lines(spacing, np.zeros(LINES), 0.0, rng)
    limit = detect(bare, fit_base(bare)).detection_limit
    assert limit < TIP
    found = 0
    for _ in range(5):
        crests = rng.uniform(-8e-3, 8e-3, LINES)
        trace = lines(spacing, crests, limit, rng)
        crossings = detect(trace, fit_base(trace)).crossings
        found += len({c.sweep for c in crossings if abs(c.point[0] - crests[c.sweep]) < max(spacing, TIP)})
    # 95 % of 60, less twice its standard deviation
    assert found >= 54


def test_there_is_no_limit_where_the_ball_passes_between_samples() -> None:
    bare = lines(2.5e-3, np.zeros(LINES), 0.0, np.random.default_rng(12))
    assert detect(bare, fit_base(bare)).detection_limit == np.inf
