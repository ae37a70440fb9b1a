"""Round lines: a ring that one turn of a helix ran along is a line, not a spot wider than the body."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Trace
from mapping.assembly import assemble
from mapping.base import fit_base
from mapping.detection import detect
from mapping.detection.path import sound_sweeps

RADIUS, TIP, PITCH = 20e-3, 2e-3, 2e-3


def helix(place: float, height: float) -> Trace:
    """Six turns of a helix over a cylinder with a ring of a height and no width about it, m."""
    angle = np.arange(0.0, 12.0 * np.pi, 4e-3)
    z = PITCH * angle / (2 * np.pi)
    out = RADIUS + np.sqrt(np.maximum((TIP + height) ** 2 - (z - place) ** 2, TIP**2))
    out += 1e-6 * np.random.default_rng(5).standard_normal(len(angle))
    centers = np.column_stack([out * np.cos(angle), out * np.sin(angle), z])
    return Trace(2e-4 * np.arange(float(len(angle))), centers, np.zeros(len(angle)), TIP)


@pytest.mark.parametrize("turns", [pytest.param(2.5, marks=pytest.mark.slow), 3.2])
def test_a_ring_that_one_turn_of_a_helix_ran_along_is_a_ridge_at_least_as_high_as_it_was_felt(turns: float) -> None:
    trace = helix(turns * PITCH, 0.1e-3)
    base = fit_base(trace)
    laid = sound_sweeps(trace, base).trace
    found = [feature for feature in assemble(detect(laid, base), laid, base) if feature.evidence.snr > 20.0]
    assert {feature.kind for feature in found} == {"ridge"} and len(found) < 3
    for ridge in found:
        assert np.abs(ridge.axis[:, 2] - turns * PITCH).max() < np.sqrt(2 * TIP * 0.1e-3)
        assert ridge.height.censored and 0.05e-3 < ridge.height.low < 0.101e-3
        assert ridge.length.low > 2.5 * RADIUS
        assert ridge.details.misfit is not None and "none crosses it" in ridge.details.misfit
