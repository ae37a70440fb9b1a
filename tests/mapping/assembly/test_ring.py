"""A ring under a raster is one closed line, though rows run along it at two places."""

from __future__ import annotations

import numpy as np
import pytest

from mapping import Trace
from mapping.assembly import assemble
from mapping.base import fit_base
from mapping.detection import detect
from mapping.inference.joint import refine_all

TIP, RADIUS, WIDTH, DEPTH, WHITE = 1e-3, 8e-3, 1.2e-3, 0.15e-3, 3e-6


@pytest.mark.slow
def test_a_groove_all_round_is_one_closed_groove() -> None:
    x, y = np.arange(-13e-3, 13e-3, 0.1e-3), np.arange(-12.83e-3, 13e-3, 0.5e-3)
    feet = np.concatenate([np.column_stack([x[:: 1 - 2 * (k % 2)], np.full(len(x), row)]) for k, row in enumerate(y)])
    inside = np.maximum(0.5 * WIDTH - np.abs(np.hypot(feet[:, 0] - 0.3e-3, feet[:, 1] + 0.2e-3) - RADIUS), 0.0)
    height = np.maximum(np.sqrt(TIP**2 - inside**2) - TIP, -DEPTH)
    height += WHITE * np.random.default_rng(5).standard_normal(len(feet))
    sweep = np.repeat(np.arange(len(y)), len(x))
    trace = Trace(1e-2 * np.arange(len(feet)), np.column_stack([feet, TIP + height]), sweep, TIP)
    base = fit_base(trace)
    detections = detect(trace, base)
    (ring,) = assemble(detections, trace, base)
    assert ring.kind == "groove" and ring.closed
    assert ring.length.median == pytest.approx(2.0 * np.pi * RADIUS, rel=2e-3)
    (told,) = refine_all((ring,), trace, 1, base=base, noise=detections.noise, confirm=None)
    assert told.width.low < WIDTH < told.width.high  # which section it has, the posterior weighs
    assert told.height.low < -DEPTH < told.height.high
    assert np.abs(np.hypot(told.axis[:, 0] - 0.3e-3, told.axis[:, 1] + 0.2e-3) - RADIUS).max() < 10e-6
