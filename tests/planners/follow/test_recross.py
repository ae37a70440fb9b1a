"""Crossing a known ridge again: over flat, bent and folded bases."""

from __future__ import annotations

import numpy as np
import pytest

from explore3d.bench.scenes.bodies import cylinder, joined, tube
from explore3d.bench.scenes.exploring import WIRE
from hw.simulated.finger import SimulatedFinger
from mapping.base.base import Base
from mapping.instrument.noise import Noise
from mapping.surface import Surface
from planners.follow.recross import flattening, seen_again
from planners.follow.sense import Sense
from planners.paths.strokes import Strokes

R = 0.01


def test_shapes_are_narrower_over_a_bent_base_and_as_wide_over_a_flat_or_folded_one() -> None:
    s = np.linspace(0.0, 0.01, 200)
    way = np.array([1.0, 0.0, 0.0])
    angle = s / 0.02
    bent = np.column_stack([np.sin(angle), 0 * s, np.cos(angle)])
    assert flattening(s, bent, way, R) == pytest.approx(np.sqrt(1.5), rel=0.01)
    flat = np.tile([0.0, 0.0, 1.0], (200, 1))
    assert flattening(s, flat, way, R) == 1.0
    fold = np.where((s > 0.0051)[:, None], [np.sin(0.7), 0.0, np.cos(0.7)], flat)
    assert flattening(s, fold, way, R) == 1.0


def test_a_ridge_along_a_cylinder_is_as_high_as_it_is() -> None:
    base = cylinder(0.02, 0.06)
    axis = np.linspace([0.02, 0.0, -0.02], [0.02, 0.0, 0.02], 40)
    outward = np.tile([1.0, 0.0, 0.0], (40, 1))
    body = joined(base, tube(axis + 0.5 * WIRE * outward, outward, 0.5 * WIRE))
    model, way, point = Base(Surface(*base)), np.array([0.0, 1.0, 0.0]), np.array([0.02, 0.0, 0.0])
    finger = SimulatedFinger(object=body, tip_radius=R, rate=2000.0)
    trace = finger.execute(Strokes(model, R).line(point, way, 0.008, 0.008))
    noise = Noise(1e-7)
    first = Sense(model, noise).nearest(trace, point, 1.0, 2e-4, 3e-3)
    assert first is not None
    again = seen_again(trace, model, noise, point, way, first, 2e-3)
    assert again is not None
    assert again.height == pytest.approx(WIRE, rel=0.01)
    assert np.linalg.norm(again.point - point) < 2e-5
